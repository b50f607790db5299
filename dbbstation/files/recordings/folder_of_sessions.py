"""Find sessions and models in a folder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.gateway import head_of
from dbbstation.files.places import real_path, text_of_name
from dbbstation.files.recorded_ground import SESSION_FILE

if TYPE_CHECKING:
    from pathlib import Path

DEEPEST = 4
"""Greatest depth of searched folders: year, machine, month, session."""

_MODEL_MARK = b"format: dbb-model/"
"""First characters of a model file; other YAML files are not read."""

_MARK_WITHIN = 4096
"""Number of first bytes of a file that may contain the mark."""


@dataclass(frozen=True)
class FolderFiles:
    """Files of a folder, by their relative paths.

    Attributes:
        sessions: session files with UTF-8 names.
        closed: unreadable folders with the reason.
    """

    sessions: dict[str, Path]
    models: dict[str, Path]
    closed: list[tuple[str, str]]


def files_of(folder: Path) -> FolderFiles:
    """Return session files and possible models in and below a folder, but not below a session.

    Links to folders are not followed.

    Raises:
        InputError: it is no folder, is a session itself, or holds none.
    """
    sessions: dict[str, Path] = {}
    models: dict[str, Path] = {}
    closed: list[tuple[str, str]] = []

    def look(here: Path, depth: int) -> None:
        try:
            with os.scandir(here) as listed:
                entries = sorted(listed, key=lambda entry: entry.name)
        except OSError as error:
            closed.append((text_of_name(here.relative_to(folder).as_posix()), reason_of(error)))
            return
        is_session = here != folder and any(entry.name == SESSION_FILE for entry in entries)
        for entry in entries:
            path = here / entry.name
            name = text_of_name(path.relative_to(folder).as_posix())
            if is_session and entry.name == SESSION_FILE:
                sessions[name] = path
            elif entry.is_file() and entry.name.endswith((".yaml", ".yml")) and _may_be_model(path):
                models[name] = path
            elif not is_session and depth < DEEPEST and not entry.name.startswith(".") and _is_folder(entry):
                look(path, depth + 1)

    if not folder.is_dir():
        what = "there is no such folder" if not folder.exists() else "this is no folder"
        raise InputError.of(folder, what, "name a folder that holds session folders")
    if (folder / SESSION_FILE).is_file():
        what = "this folder is one session, a history is of a folder that holds several"
        raise InputError.of(folder, what, f"name the folder that contains it: {real_path(folder).parent}")
    look(folder, 1)
    if not sessions:
        raise InputError([_no_sessions(folder)])
    return FolderFiles(sessions, models, closed)


def reason_of(error: OSError) -> str:
    """Return the system's reason for a refusal."""
    return (error.strerror or str(error)).lower()


def _is_folder(entry: os.DirEntry[str]) -> bool:
    return entry.is_dir(follow_symlinks=False)


def _may_be_model(path: Path) -> bool:
    try:
        return _MODEL_MARK in head_of(path, _MARK_WITHIN)
    except OSError:
        return False


def _no_sessions(folder: Path) -> Problem:
    what = f"no folder in it holds a {SESSION_FILE}, {DEEPEST} folders deep"
    return Problem(str(folder), 0, 0, what, "name a folder that holds the session folders of `measure` or `simulate`")
