"""Sessions to continue, in a folder or remembered."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.recordings.entries import RunState
from dbbstation.files.recordings.session import SESSION_FILE, read_session
from dbbstation.plan.duration import circles_s
from dbbstation.station.schedule import Schedule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dbbstation.files.recordings.session import SessionFolder

DEPTH = 2
"""Folders below the one that is searched: sessions of a machine, of a month."""

MOST = 30
"""Sessions that are read: each takes some hundredths of a second, and nobody looks further back here."""


@dataclass(frozen=True)
class SessionLine:
    """One session.

    Attributes:
        changed: last writing of its file.
        accepted: planned runs with accepted recording.
        unjudged: runs without verdict.
        left_s: time of the remaining circles.
        problem: why it cannot continue; may be empty.
    """

    folder: Path
    changed: datetime
    plan: str = ""
    machine: str = ""
    accepted: int = 0
    planned: int = 0
    unjudged: int = 0
    left_s: float = 0.0
    problem: str = ""
    virtual: bool = False

    @property
    def complete(self) -> bool:
        """Return whether nothing is left to measure."""
        return not self.problem and self.accepted == self.planned


def list_sessions(under: Path, remembered: Iterable[Path] = ()) -> tuple[SessionLine, ...]:
    """Return sessions, last written first.

    Args:
        under: searched with subfolders.
        remembered: further folders; missing ones are ignored.
    """
    return tuple(_line(folder, datetime.fromtimestamp(at, UTC)) for at, folder in dated_folders(under, remembered))


def dated_folders(under: Path, remembered: Iterable[Path] = ()) -> list[tuple[float, Path]]:
    """Return session folders with their files' times [s since 1970]; arguments as of `list_sessions`."""
    folders = {folder.absolute() for folder in (*_found(under, DEPTH), *remembered)}
    dated = []
    for folder in folders:
        try:
            dated.append(((folder / SESSION_FILE).stat().st_mtime, folder))
        except OSError:
            continue
    dated.sort(key=lambda one: (-one[0], one[1]))
    return dated[:MOST]


def _found(folder: Path, depth: int) -> Iterator[Path]:
    try:
        inside = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        is_session = (folder / SESSION_FILE).is_file()
    except OSError:
        return
    if is_session:
        yield folder
    elif depth:
        for path in inside:
            yield from _found(path, depth - 1)


def _line(folder: Path, changed: datetime) -> SessionLine:
    try:
        session = read_session(folder)
    except InputError as error:
        return SessionLine(folder, changed, problem=error.problems[0].what)
    schedule = schedule_of(session)
    circles = [session.plan.tests[task.test].run(task.direction) for task in schedule.open]
    return SessionLine(
        folder=folder,
        changed=changed,
        plan=session.plan.name,
        machine=session.machine.name,
        accepted=schedule.accepted,
        planned=len(schedule.tasks),
        unjudged=len(session.in_state(RunState.COMPLETE)),
        left_s=circles_s(circles),
        virtual=session.virtual is True,
    )


def schedule_of(session: SessionFolder) -> Schedule:
    """Return done and left runs of a session, read only."""
    return Schedule(session.plan, lambda _test, _direction: 1, session.runs)
