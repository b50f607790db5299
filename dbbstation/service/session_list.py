"""Files to choose from, and sessions to continue, in a folder or remembered."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.session import RunState
from dbbstation.files.gateway import head_of
from dbbstation.files.places import SESSION_FILE, shipped_folder
from dbbstation.files.recordings.former import DEPTH, dated_folders, folders_in
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.plan import circles_s
from dbbstation.station.schedule import Schedule

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


@dataclass(frozen=True)
class SessionLine:
    """One session.

    Attributes:
        accepted: planned runs with accepted recording.
        left_s: time of the remaining circles.
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
        """Return whether every planned run is accepted."""
        return not self.problem and self.accepted == self.planned


def list_sessions(under: Path, remembered: Iterable[Path] = ()) -> tuple[SessionLine, ...]:
    """Return sessions, last written first."""
    return tuple(_line(folder, datetime.fromtimestamp(at, UTC)) for at, folder in dated_folders(under, remembered))


def _line(folder: Path, changed: datetime) -> SessionLine:
    try:
        session = read_session(folder)
    except InputError as error:
        return SessionLine(folder, changed, problem=error.problems[0].what)
    schedule = Schedule(session.plan, recorded=session.runs)
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


class CandidateFormat(StrEnum):
    """Formats to choose from; the value is the begin of their `format` key."""

    MACHINE = "dbb-machine/"
    PLAN = "dbb-plan/"
    BAR = "dbb-bar/"
    MODEL = "dbb-model/"


_HEAD = 4096
"""Number of bytes at a file's begin that contain its format, behind the comments at its top."""

_SHIPPED = {
    CandidateFormat.MACHINE: ("fixtures", "machines/reference.yaml"),
    CandidateFormat.PLAN: ("protocols", "plans/*.yaml"),
}
"""Examples that come with the package."""


def candidates(kind: CandidateFormat, under: Path, *, shipped: bool = True) -> tuple[Path, ...]:
    """Return the files of a format, first those in a folder; copies in sessions are left out."""
    outside = (inside for folder, inside in folders_in(under, DEPTH) if folder / SESSION_FILE not in inside)
    own = [path for inside in outside for path in inside if path.suffix in {".yaml", ".yml"} and _is(kind, path)]
    if not shipped or kind not in _SHIPPED:
        return tuple(own)
    folder, pattern = _SHIPPED[kind]
    of_package = [path for path in sorted(shipped_folder(folder).glob(pattern)) if path not in own]
    return (*own, *of_package)


def _is(kind: CandidateFormat, path: Path) -> bool:
    try:
        head = head_of(path, _HEAD)
    except OSError:
        return False
    return re.search(rb"^format:\s*['\"]?" + re.escape(kind.encode()), head, re.MULTILINE) is not None
