"""Find sessions and models in a folder, and earlier sessions of the same machine, plan and jig."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.session import starts_of
from dbbstation.files.gateway import head_of
from dbbstation.files.places import SESSION_FILE, real_path, text_of_name
from dbbstation.files.recordings.session import parse_session
from dbbstation.machine.geometry import differences

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from datetime import datetime
    from pathlib import Path

    from dbbstation.files.recordings.session import SessionFolder


DEPTH = 2
"""Searched levels of subfolders, such as one per machine, then one per month."""

MOST = 30
"""Greatest number of sessions that are read, the newest first; each needs some hundredths of a second."""


def former_sessions(
    now: SessionFolder, under: Path, tests: set[str] | None = None
) -> list[tuple[datetime, SessionFolder]]:
    """Return earlier sessions of the same machine, plan and jig, the latest first. A real session gets only real ones, a virtual session only virtual ones."""
    accepted = now.accepted
    began = min(starts_of(accepted), default=None)
    tests = tests or {run.test for run in accepted} or set(now.plan.tests)
    found = []
    for _, folder in dated_folders(under):
        if folder == now.folder.absolute():
            continue
        faults: list[Problem] = []
        then = parse_session(
            folder, faults
        )  # not `read_session`: a virtual neighbour would mark this session's outputs
        if then is None or faults:
            continue  # the list of sessions says what is wrong with it
        runs = then.accepted
        ended = max(starts_of(runs), default=None)
        measured = {run.test for run in runs}
        if ended is not None and (began is None or ended < began) and tests <= measured and _alike(now, then, tests):
            found.append((ended, then))
    return sorted(found, key=lambda one: one[0], reverse=True)


def dated_folders(under: Path, remembered: Iterable[Path] = ()) -> list[tuple[float, Path]]:
    """Return session folders with their files' times [s since 1970]; arguments as of `list_sessions`."""
    found = (folder for folder, inside in folders_in(under, DEPTH) if folder / SESSION_FILE in inside)
    folders = {folder.absolute() for folder in (*found, *remembered)}
    dated = []
    for folder in folders:
        try:
            dated.append(((folder / SESSION_FILE).stat().st_mtime, folder))
        except OSError:
            continue
    dated.sort(key=lambda one: (-one[0], one[1]))
    return dated[:MOST]


def folders_in(under: Path, depth: int) -> Iterator[tuple[Path, list[Path]]]:
    """Return readable folders with their sorted content, but none below a session or with a name that begins with a dot."""
    try:
        inside = sorted(under.iterdir())
    except OSError:
        return
    yield under, inside
    if depth and under / SESSION_FILE not in inside:
        for path in inside:
            if path.is_dir() and not path.name.startswith("."):
                yield from folders_in(path, depth - 1)


def _alike(now: SessionFolder, then: SessionFolder, tests: set[str]) -> bool:
    if bool(now.virtual) is not bool(then.virtual):
        return False
    serials = {one.serial_number for one in (now, then) if one.serial_number}
    asked = [
        {name: (one.ball, one.circle) for name, one in session.plan.tests.items() if name in tests}
        for session in (now, then)
    ]
    same = asked[0] == asked[1] and asked[0].keys() == tests
    return len(serials) < 2 and same and not differences(now.machine, then.machine)  # noqa: PLR2004 - two different ones


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
            elif (
                not is_session
                and depth < DEEPEST
                and not entry.name.startswith(".")
                and entry.is_dir(follow_symlinks=False)
            ):
                look(path, depth + 1)

    if not folder.is_dir():
        what = "there is no such folder" if not folder.exists() else "this is no folder"
        raise InputError.of(folder, what, "name a folder that holds session folders")
    if (folder / SESSION_FILE).is_file():
        what = "this folder is one session, a history is of a folder that holds several"
        raise InputError.of(folder, what, f"name the folder that contains it: {real_path(folder).parent}")
    look(folder, 1)
    if not sessions:
        what = f"no folder in it holds a {SESSION_FILE}, {DEEPEST} folders deep"
        raise InputError.of(folder, what, "name a folder that holds the session folders of `measure` or `simulate`")
    return FolderFiles(sessions, models, closed)


def reason_of(error: OSError) -> str:
    """Return the system's reason for a refusal."""
    return (error.strerror or str(error)).lower()


def _may_be_model(path: Path) -> bool:
    try:
        return _MODEL_MARK in head_of(path, _MARK_WITHIN)
    except OSError:
        return False
