"""Assemble a station: plan, session folder, storage and sequencer for one instrument."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dbbstation.errors import Faults, InputError, Problem, refuse
from dbbstation.files.formats.session import ReadBy, RunState, SessionDetails
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session_checks import unlike_bar
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.machine.geometry import check_model_is_of
from dbbstation.plan.plan import circles_s
from dbbstation.station.detector import Patience
from dbbstation.station.engine import Station
from dbbstation.station.events import RunCompleted, RunId, Sample
from dbbstation.station.judging import RunJudge
from dbbstation.station.opening import changed_since, clock_watch, last_end, open_session
from dbbstation.station.run_record import circle_figures
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer, Waiting
from dbbstation.station.storage import Storage, time_of_day
from dbbstation.system.mounts import free_bytes
from dbbstation.system.ports import is_virtual, time_scale_of
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.files.recordings.session_writer import SessionWriter
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.plan import Direction, Plan
    from dbbstation.quality.finding import Finding
    from dbbstation.station.engine import ReadingSource
    from dbbstation.station.programs import RunProgram
    from dbbstation.trace.recording import RawCircle, Recording


def check_plan(plan: Plan, machine: Machine, *, file: str) -> None:
    """Dry-run a plan.

    Raises:
        InputError: readings cannot show a test's begin and end; names every such test.
        TravelError: a circle leaves the machine's travel; names test, direction, pose and limit.
    """
    faults = Faults(file)
    for test in plan.tests.values():
        if test.circle.feed_in_mm <= 0.0:
            what = f"test {test.name} has no feed-in: a recording of it cannot be cut"
            faults.add(what, "give `feed_in_mm` in its path, 1.5 mm is usual")
    refuse(faults)
    plan.check(machine)


def check_range(plan: Plan, range_mm: tuple[float, float], *, file: str) -> None:
    """Check the lengths of a plan's circles against the instrument's range.

    Raises:
        InputError: a circle or feed-in lies outside; names every such test.
    """
    low_mm, high_mm = range_mm
    faults = Faults(file)
    for test in plan.tests.values():
        bar_mm, outside_mm = test.circle.bar_mm, test.circle.bar_mm + test.circle.feed_in_mm
        if low_mm <= bar_mm and outside_mm <= high_mm:
            continue
        what = (
            f"test {test.name}: the bar goes from {bar_mm:g} to {outside_mm:g} mm with its feed-in, and the instrument"
        )
        remedy = "take an instrument or a profile with more range, or a shorter `feed_in_mm` in its path"
        faults.add(f"{what} reads {low_mm:g} to {high_mm:g} mm", remedy)
    refuse(faults)


def unjudged(
    session: SessionFolder, judge: Callable[[RunId, Recording], tuple[Finding, ...]] = lambda _run, _recording: ()
) -> list[Waiting]:
    """Return unjudged runs in recording order."""
    return [_waiting(session, entry, judge) for entry in session.runs if entry.state is RunState.COMPLETE]


def _waiting(
    session: SessionFolder, entry: RunEntry, judge: Callable[[RunId, Recording], tuple[Finding, ...]]
) -> Waiting:
    run = RunId(entry.test, entry.direction, entry.repeat, entry.mounting or 0)
    try:
        recording = session.load(entry).recording
    except InputError as error:
        return Waiting(RunCompleted(run, 0, 0, None, str(error)), ())
    circle = session.circle(entry)
    lost = entry.counts.lost if entry.counts is not None else 0
    found, problem = circle_figures(recording, circle, lost, lost, session.plan.largest_loss_percent)
    samples = () if found is None else _on_turn(cut(recording, circle))
    findings = () if found is None else judge(run, recording)
    doubtful = 0 if entry.counts is None else entry.counts.rejected.get(DOUBTFUL, 0)
    return Waiting(RunCompleted(run, len(recording), lost, found, problem, findings, doubtful), samples)


def _on_turn(raw: RawCircle) -> tuple[Sample, ...]:
    step = max(len(raw) // MOST_SHOWN, 1)
    rows = zip(raw.t_s[::step].tolist(), raw.length_mm[::step].tolist(), raw.phi_deg[::step].tolist(), strict=True)
    return tuple(Sample(t_s, length_mm, phi_deg=phi_deg) for t_s, length_mm, phi_deg in rows)


MOST_SHOWN = 3600
"""Approximate number of samples of a turn that are redrawn: ten for each degree."""


@dataclass(frozen=True, eq=False)
class Job:
    """A measurement: machine, plan and session folder.

    Attributes:
        plan: contains its jig.
        details: facts for a new session; an existing one keeps its own.
        programs: by test and direction; empty: plain nominal circles.
        time_scale: machine time over real time; other than 1 only for a virtual machine.
        range_mm: lowest and highest length that the instrument reads; None: not known.
        model: source of expected circles; None: the nominal geometry.
    """

    machine: Machine
    plan: PlanFile
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

    def read_by(self, protocol: Protocol, profile: str, port: str, baud: int | None) -> Job:
        """Return the job with its instrument."""
        by = ReadBy(protocol.name, profile, port, time_scale_of(port) is not None or is_virtual(port))
        rate_hz = protocol.fastest_hz(baud)
        return replace(self, rate_hz=rate_hz, range_mm=protocol.length.range_mm, instrument=by)

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
            raise InputError([Problem.of(plan_file, *fault)])
        self._check_room(plan)
        check_plan(plan, self.machine, file=plan_file)
        if self.range_mm is not None:
            check_range(plan, self.range_mm, file=plan_file)

    def _check_room(self, plan: Plan) -> None:
        needed = LEAST_FREE + BYTES_PER_READING * (self.rate_hz or 0.0) * circles_s(plan.runs().values())
        free = free_bytes(self.folder)
        if free is not None and free < needed:
            what = f"the disk has {free / 1e6:.0f} MB free, the session needs {needed / 1e6:.0f} MB"
            raise InputError.of(self.folder, what, "free some, or use another folder")


BYTES_PER_READING = 100
"""Size of a row of a run file, with the same size for its journal and copies [bytes]."""

LEAST_FREE = 50e6
"""Space for session file, log and report, in addition to the readings [bytes]."""


@dataclass(frozen=True, eq=False)
class Workplace:
    """A station ready to run; close it in any case."""

    station: Station
    schedule: Schedule
    writer: SessionWriter
    judge: RunJudge
    _storage: Storage

    def close(self) -> None:
        """Write everything to the disk and unlock the session for other programs."""
        try:
            self._storage.close()
        finally:
            self.writer.close()


def assemble(
    job: Job, source: ReadingSource, unreadable: Callable[[], Mapping[str, int]] = dict, *, asked: bool = False
) -> Workplace:
    """Open the session and build the station. Storage is the station's first observer.

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
