"""Targets of paths, with links resolved, their names, and the folders of the package and of sessions."""

from __future__ import annotations

import os
from pathlib import Path

from dbbstation.errors import InputError, OutputError
from dbbstation.files.gateway import head_of


def real_path(path: Path) -> Path:
    """Return the absolute target of a path; of circular links, the link itself.

    `Path.resolve` raises `RuntimeError` there before Python 3.13.
    """
    return Path(os.path.realpath(path))


def unused_path(folder: Path, name: str, suffix: str = "") -> Path:
    """Return an unused path with this name, numbered if necessary."""
    numbered = (folder / f"{name if k == 1 else f'{name}-{k}'}{suffix}" for k in range(1, MOST_NUMBERED))
    return next(path for path in numbered if not path.exists())


MOST_NUMBERED = 10_000
"""Greatest number that is tried in a name."""


def name_of(path: Path) -> str:
    r"""Return the name of a path's target as text; a byte that is no UTF-8 shows as `\xfc`."""
    return text_of_name(real_path(path).name)


def text_of_name(name: str) -> str:
    """Return a name or path as text; see `name_of`."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def shipped_folder(name: str) -> Path:
    """Return a shipped folder, such as `protocols`.

    Raises:
        InputError: the installation lacks it.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise InputError.of(package / name, "this folder is missing in the installation", "install dbbstation again")


def package_text(name: str) -> str:
    """Return a text file of the package, by its path in the package."""
    return (Path(__file__).resolve().parent.parent / name).read_text(encoding="utf-8")


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
        return file.is_file() and ((folder / RUNS).is_dir() or _MARK in head_of(file, _WITHIN))
    except OSError:
        return False


DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{kind}{n}" for kind in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows reserves before the first point of a file name, in any case (Microsoft, "Naming Files, Paths, and
Namespaces")."""


def is_device(name: str) -> bool:
    """Return whether Windows treats a name as a device."""
    return name.partition(".")[0].lower() in DEVICES
