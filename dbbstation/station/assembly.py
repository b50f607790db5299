"""Assemble a station: plan, session folder, storage and sequencer about one instrument."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.recordings.bar_reach import unlike_bar
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session_details import SessionDetails
from dbbstation.machine.difference import check_model_is_of
from dbbstation.plan.duration import circles_s
from dbbstation.station.detector import Patience
from dbbstation.station.engine import Station
from dbbstation.station.judging import RunJudge
from dbbstation.station.opening import changed_since, clock_watch, last_end, open_session
from dbbstation.station.preflight import check_plan, check_range
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.storage import Storage, time_of_day
from dbbstation.station.unjudged import unjudged
from dbbstation.system.mounts import free_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from dbbstation.files.formats.plan import InlinePlan
    from dbbstation.files.recordings.entries import ReadBy
    from dbbstation.files.recordings.session_writer import SessionWriter
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.circle import Direction
    from dbbstation.plan.plan import Plan
    from dbbstation.station.engine import ReadingSource
    from dbbstation.station.programs import RunProgram


@dataclass(frozen=True, eq=False)
class Job:
    """What is measured, on what, into what.

    Attributes:
        plan: jig inlined.
        details: for a new session; an existing one keeps its own.
        programs: by test and direction; empty: plain nominal circles.
        time_scale: speed of that time; other than 1 only for a virtual machine.
        range_mm: lowest and highest length that it reads; None: not known.
        model: source of expected circles; None: the nominal geometry.
    """

    machine: Machine
    plan: InlinePlan
    folder: Path
    details: SessionDetails = field(default_factory=SessionDetails)
    programs: Mapping[tuple[str, Direction], RunProgram] = field(default_factory=dict)
    patience: Patience = field(default_factory=Patience)
    clock: Callable[[], float] = time.monotonic
    time_scale: float = 1.0
    rate_hz: float | None = None
    range_mm: tuple[float, float] | None = None
    model: IdentifiedModel | None = None
    instrument: ReadBy | None = None

    def check(self, plan_file: str) -> None:
        """Dry-run the plan before an instrument is opened.

        Raises:
            InputError: readings cannot follow a test, or bar or instrument cannot reach it.
            ModelError: the model is of another machine.
            TravelError: a circle leaves the machine's travel.
        """
        if self.model is not None:
            check_model_is_of(self.machine, self.model.model.machine)
        plan = self.plan.to_domain()
        bar = self.details.bar
        fault = None if bar is None else unlike_bar(bar.calibrated_length_mm, bar.stroke_mm, plan)
        if fault is not None:
            raise InputError([Problem(plan_file, 0, 0, *fault)])
        self._check_room(plan)
        check_plan(plan, self.machine, file=plan_file)
        if self.range_mm is not None:
            check_range(plan, self.range_mm, file=plan_file)

    def _check_room(self, plan: Plan) -> None:
        circles = [test.run(direction) for test in plan.tests.values() for direction in test.directions]
        needed = LEAST_FREE + BYTES_PER_READING * (self.rate_hz or 0.0) * circles_s(circles)
        free = free_bytes(self.folder)
        if free is not None and free < needed:
            what = f"the disk has {free / 1e6:.0f} MB free, the session needs {needed / 1e6:.0f} MB"
            raise InputError.of(self.folder, what, "free some, or use another folder")


BYTES_PER_READING = 100
"""A row of a run file, and the same again for its journal and copies."""

LEAST_FREE = 50e6
"""Room for everything beside the readings: session file, log, report [bytes]."""


@dataclass(frozen=True, eq=False)
class Workplace:
    """A station ready to run; close it in any case."""

    station: Station
    schedule: Schedule
    writer: SessionWriter
    judge: RunJudge
    _storage: Storage

    def close(self) -> None:
        """Sync everything to disk and let others write."""
        try:
            self._storage.close()
        finally:
            self.writer.close()


def assemble(
    job: Job, source: ReadingSource, unreadable: Callable[[], Mapping[str, int]] = dict, *, asked: bool = False
) -> Workplace:
    """Open the session and build the station; storage is its first observer.

    Args:
        unreadable: rejected bytes so far, by fault.

    Raises:
        InputError: the folder holds another session, or one with faults.
        OutputError: the folder cannot be written.
    """
    details = replace(job.details, instrument=job.instrument)
    writer = open_session(job.folder, job.machine, job.plan, details, with_programs=bool(job.programs))
    plan = job.plan.to_domain()
    kept = {
        key: writer.add_program(program.name, program.content, model_sha256=program.model_sha256)
        for key, program in job.programs.items()
    }
    schedule = Schedule(plan, writer.next_repeat, writer.runs)
    names = {key: program.name for key, program in job.programs.items()}
    # Real runs bear the computer's time, so that they fit what thermometers log.
    now = None if job.time_scale == 1.0 else time_of_day(job.clock, last_end(writer.session))
    storage = Storage(writer, now, kept, unreadable, asked=asked, instrument=job.instrument)
    former = next((one for _, one in former_sessions(writer.session, job.folder.absolute().parent)), None)
    judge = RunJudge(writer, kept, job.model, former)
    sequencer = Sequencer(
        plan,
        schedule,
        storage.recorded,
        programs=names,
        patience=job.patience,
        judge=judge.judge,
        doubted=judge.doubted,
        waiting=unjudged(writer.session, judge.judge),
        rate_hz=job.rate_hz,
    )
    station = Station(sequencer, source)
    station.subscribe(storage)
    station.subscribe(judge)
    station.regularly(storage.sync_if_due)
    if now is None:
        station.regularly(clock_watch(station.send))
    for note in changed_since(writer.session, details):
        station.send(note)
    return Workplace(station, schedule, writer, judge, storage)
