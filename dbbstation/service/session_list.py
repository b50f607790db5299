"""Sessions to continue, in a folder or remembered."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.former import dated_folders
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.circle import circles_s
from dbbstation.station.schedule import Schedule

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from dbbstation.files.recordings.session import SessionFolder


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
    """Return finished and remaining runs of a session, without writing."""
    return Schedule(session.plan, lambda _test, _direction: 1, session.runs)
