"""Make a session folder, or continue an existing one."""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem, refuse
from dbbstation.files.formats.machine import machine_data
from dbbstation.files.formats.plan import plan_data, read_inline_plan
from dbbstation.files.formats.session import starts_of
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.event_log import CLOCK_S, EVENTS_FILE
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.station.commands import AddNote

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import ReadBy, SessionDetails
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.machine.geometry import Machine


def check_session(
    folder: Path,
    machine: Machine,
    plan: PlanFile,
    details: SessionDetails,
    *,
    with_programs: bool,
    session: SessionFolder,
) -> None:
    """Refuse to continue a session with another machine, plan or kind of programs, or with a virtual machine instead of a real one.

    Raises:
        InputError: everything that differs.
    """
    faults = []
    if machine_data(machine) != machine_data(session.machine):
        what = "the machine of this session is another one"
        faults.append(Problem.of(session.machine_path, what, "give its machine file, or another --out"))
    if plan_data(plan) != plan_data(read_inline_plan(session.plan_path)):
        what = "the plan of this session is another one"
        faults.append(Problem.of(session.plan_path, what, "give its plan file, or another --out"))
    other = [run for run in session.accepted if (run.program is not None) is not with_programs]
    if other:
        was, now = ("plain circles", "NC programs") if with_programs else ("NC programs", "plain circles")
        what = f"its runs were commanded by {was}, now {now} are asked for"
        faults.append(Problem.of(folder, what, "measure them into a separate session"))
    faults += _mixed(folder, session, details.instrument)
    refuse(faults)


def _mixed(folder: Path, session: SessionFolder, instrument: ReadBy | None) -> list[Problem]:
    if instrument is None or (not session.runs and session.virtual is None):
        return []
    if bool(session.virtual) is instrument.virtual:
        return []
    kinds = {True: "a virtual machine", False: "a real machine", None: "a machine that is not noted as virtual"}
    what = f"this session is of {kinds[session.virtual]}, and {instrument.text} is that of {kinds[instrument.virtual]}"
    return [Problem.of(folder, what, "measure into a new session: give another --out")]


def check_not_mixed(folder: Path, session: SessionFolder, instrument: ReadBy | None) -> None:
    """Refuse to mix virtual and real circles in a session.

    Raises:
        InputError: they would be mixed.
    """
    refuse(_mixed(folder, session, instrument))


def open_session(
    folder: Path, machine: Machine, plan: PlanFile, details: SessionDetails, *, with_programs: bool
) -> SessionWriter:
    """Make a session folder, or continue it with the same machine and plan.

    Raises:
        InputError: the folder holds another session, or one with faults.
        OutputError: it exists and is no session, or cannot be written.
    """
    if not any((folder / name).is_file() for name in (SESSION_FILE, EVENTS_FILE)):
        return SessionWriter.create(folder, machine, plan, details)
    writer = SessionWriter.open(folder)
    try:
        check_session(folder, machine, plan, details, with_programs=with_programs, session=writer.session)
    except InputError:
        writer.close()
        raise
    return writer


SHIFT_S = 8.0 * 3600.0
"""Length of a shift [s]: after it another person may continue, and ball and holder may have been touched."""

_OPERATOR = "operator from here on: "


def changed_since(session: SessionFolder, details: SessionDetails) -> Iterator[AddNote]:
    """Yield notes on changes since a session was interrupted: operator, temperature, shift, a clock that was set back."""
    by = [note.text.removeprefix(_OPERATOR) for note in session.notes if note.text.startswith(_OPERATOR)]
    if details.operator not in {"", (by or [session.operator])[-1]}:
        yield AddNote(f"{_OPERATOR}{details.operator}")
    known = [session.ambient_temp_c, *(note.ambient_temp_c for note in session.notes)]
    if details.ambient_temp_c not in {None, next((one for one in reversed(known) if one is not None), None)}:
        yield AddNote(ambient_temp_c=details.ambient_temp_c)
    noted = starts_of(session.runs) + [note.made for note in session.notes]
    if session.virtual or not noted:
        return
    since_s = (datetime.now(UTC) - max(noted)).total_seconds()
    if since_s < -CLOCK_S:
        yield AddNote(f"the computer's clock is {-since_s:.0f} s behind what was noted last: it was set back")
    elif since_s > SHIFT_S:
        yield AddNote(f"gone on with {since_s / 3600.0:.0f} h after what was noted last")


def clock_watch(
    tell: Callable[[AddNote], None],
    wall: Callable[[], float] = time.time,
    steady: Callable[[], float] = time.monotonic,
) -> Callable[[], None]:
    """Return a function that reports when the computer's clock was set, or the computer has slept."""
    ahead_s = [wall() - steady()]

    def look() -> None:
        now_s = wall() - steady()
        step_s, ahead_s[0] = now_s - ahead_s[0], now_s
        if abs(step_s) > CLOCK_S:
            tell(AddNote(f"the computer's clock was set {'on' if step_s > 0.0 else 'back'} by {abs(step_s):.0f} s"))

    return look


def last_end(session: SessionFolder) -> datetime | None:
    """Return the latest possible end of the last run, or None."""
    started = [(run.started, session.circle(run).swept_s) for run in session.runs if run.started is not None]
    return max((began + timedelta(seconds=2.0 * swept_s) for began, swept_s in started), default=None)
