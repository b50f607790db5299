"""Names in a session folder, and the refusal to write results into it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import OutputError
from dbbstation.files.gateway import head_of
from dbbstation.files.places import real_path

if TYPE_CHECKING:
    from pathlib import Path

SESSION_FILE = "session.yaml"
"""File that marks a session folder."""

MACHINE_FILE, PLAN_FILE, RUNS, PROGRAMS = "machine.yaml", "plan.yaml", "runs", "programs"
"""Other names in a session of this program."""

_MARK, _WITHIN = b"dbb-session/", 4096
"""First characters of a session file, and the number of bytes that must contain them."""


def session_around(path: Path) -> Path | None:
    """Return the session folder around a path, or None.

    Links are followed. A damaged session file still marks its folder.
    """
    return next((folder for folder in real_path(path).parents if _is_session(folder)), None)


def refuse_recorded(path: Path) -> None:
    """Refuse to write a result into a session folder.

    Raises:
        OutputError: the path lies in a session folder.
    """
    session = session_around(path)
    if session is not None:
        what = f"this lies in the session {session}, where only recordings lie"
        raise OutputError(what, where=str(path), remedy="name a file outside of it, such as one beside it")


def _is_session(folder: Path) -> bool:
    file = folder / SESSION_FILE
    try:
        if not file.is_file():
            return False
        if (folder / "runs").is_dir():
            return True
        return _MARK in head_of(file, _WITHIN)
    except OSError:
        return False
