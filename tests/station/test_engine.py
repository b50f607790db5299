from __future__ import annotations

import errno
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InstrumentError, OutputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan, read_plan
from dbbstation.files.formats.session import Counts
from dbbstation.files.recordings.journal import RunWriter
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.plan import Direction
from dbbstation.station import events, storage
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Accept, AddNote, Quit, Repeat, Skip, Start
from dbbstation.station.engine import Station
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.states import State
from dbbstation.station.storage import time_of_day
from tests.station.bench import MACHINE_FILE
from tests.station.readings import run_readings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from datetime import tzinfo
    from pathlib import Path

    from dbbstation.errors import StationError
    from dbbstation.instrument.reading import Reading


class Script:
    """An instrument that brings a list of readings, then nothing, or an error."""

    def __init__(self, readings: Sequence[Reading] = (), error: StationError | None = None) -> None:
        self.readings = list(readings)
        self.error = error
        self.armed = False

    def drain(self) -> Sequence[Reading]:
        if not self.armed:
            return []
        if not self.readings and self.error is not None:
            raise self.error
        now, self.readings = self.readings[:5], self.readings[5:]
        return now

    def __call__(self, event: events.Event) -> None:
        if isinstance(event, events.StateChanged):
            self.armed = event.state not in {State.BETWEEN, State.ANNOUNCED}


def made(plan_file: Path, source: Script) -> Station:
    plan = read_plan(plan_file)
    return Station(Sequencer(plan, Schedule(plan, lambda *_: 1), recording_of), source)


def accepts_ccw(station: Station) -> Callable[[events.Event], None]:
    """Return an operator who accepts each complete circle, and goes when the cw one is announced."""

    def operate(event: events.Event) -> None:
        if isinstance(event, events.StateChanged) and event.state is State.COMPLETE:
            station.send(Accept())
        elif isinstance(event, events.RunAnnounced):
            station.send(Quit() if event.run.direction is Direction.CW else Start())

    return operate


def test_commands_from_another_thread_wake_it(plan_file: Path) -> None:
    station = made(plan_file, Script())
    told: list[events.Event] = []
    station.subscribe(told.append)
    timers = [threading.Timer(0.05 * k, station.send, [command]) for k, command in enumerate([Skip(), Skip(), Quit()])]
    for timer in timers:
        timer.start()
    assert station.run() is State.STOPPED
    assert sum(isinstance(event, events.RunAnnounced) for event in told) == 3


def test_an_instrument_that_fails_is_told_of_and_raised(plan_file: Path) -> None:
    source = Script(error=InstrumentError("the line was closed", where="/dev/x"))
    station = made(plan_file, source)
    told: list[events.Event] = []
    station.subscribe(source)
    station.subscribe(told.append)
    station.send(Start())
    with pytest.raises(InstrumentError, match="line was closed"):
        station.run()
    assert any(isinstance(event, events.Fault) and event.error is source.error for event in told)
    assert station.state is State.FAULTED


def test_storage_that_fails_ends_the_sequence_and_the_screen_hears_of_it(plan_file: Path) -> None:
    source = Script(run_readings(read_plan(plan_file).tests["a"].circle))
    station = made(plan_file, source)
    told: list[events.Event] = []

    def full(event: events.Event) -> None:
        if isinstance(event, events.RunStarted):
            raise OutputError("no space left", where="/disk")
        if isinstance(event, events.Fault):
            raise OutputError("still no space")

    for observer in (full, source, told.append):
        station.subscribe(observer)
    station.send(Start())
    with pytest.raises(OutputError, match="no space left") as caught:
        station.run()
    assert caught.value.__notes__ == ["still no space"]
    assert isinstance(told[-2], events.Fault)
    assert told[-1] == events.StateChanged(State.FAULTED, frozenset())


def test_what_is_stored_is_what_was_read(plan_file: Path, tmp_path: Path) -> None:
    plan = read_inline_plan(plan_file)
    circle = plan.to_domain().tests["a"].circle
    source = Script(run_readings(circle, 1000.0) + run_readings(circle, 1100.0))
    job = Job(read_machine(MACHINE_FILE), plan, tmp_path / "session")
    workplace = assemble(job, source)
    station = workplace.station
    told: list[events.Event] = []
    for observer in (source, told.append):
        station.subscribe(observer)

    def judge(event: events.Event) -> None:
        if isinstance(event, events.StateChanged) and event.state is State.COMPLETE:
            repeats = sum(isinstance(each, events.RunCompleted) for each in told)
            station.send(Repeat("a bump") if repeats == 1 else Accept())
        elif isinstance(event, events.RunAnnounced):
            station.send(Quit() if event.run.direction is Direction.CW else Start())

    station.subscribe(judge)
    assert station.run() is State.STOPPED
    workplace.close()
    session = read_session(tmp_path / "session")
    assert [(run.label, run.state.value, run.reason, run.mounting) for run in session.runs] == [
        ("a ccw 1", "rejected", "a bump", 1),
        ("a ccw 2", "accepted", "", 1),
    ]
    for run in session.runs:
        stored = read_run(run.path).recording
        seen = [
            sample
            for event in told
            if isinstance(event, events.SamplesRecorded) and event.run.repeat == run.repeat
            for sample in event.samples
        ]
        assert stored.t_s.tolist() == pytest.approx([sample.t_s for sample in seen], abs=1e-6)
        assert stored.length_mm.tolist() == pytest.approx([sample.length_mm for sample in seen], abs=1e-6)


def test_readings_that_are_asked_for_keep_the_uncertainty_of_their_time(plan_file: Path, tmp_path: Path) -> None:
    plan = read_inline_plan(plan_file)
    plain = run_readings(plan.to_domain().tests["a"].circle, 1000.0)
    source = Script([replace(one, t_uncertainty_s=1e-3 * (2 + n % 3)) for n, one in enumerate(plain)])
    workplace = assemble(Job(read_machine(MACHINE_FILE), plan, tmp_path / "session"), source, asked=True)
    for observer in (source, accepts_ccw(workplace.station)):
        workplace.station.subscribe(observer)
    workplace.station.run()
    workplace.close()
    (run,) = read_session(tmp_path / "session").runs
    read = read_run(run.path)
    known_s = read.recording.logged["t_uncertainty_s"]
    first = round(1e3 * known_s[0]) - 2
    assert known_s.tolist() == pytest.approx([1e-3 * (2 + (n + first) % 3) for n in range(len(known_s))], abs=1e-9)
    assert not read.warnings


def test_what_came_over_the_line_is_counted_in_run_file_and_session(plan_file: Path, tmp_path: Path) -> None:
    plan = read_inline_plan(plan_file)
    readings = run_readings(plan.to_domain().tests["a"].circle, 1000.0)
    # Lost on the arc, few enough for the plan; without a length in the dwell before it, where that harms nothing.
    readings[300] = replace(readings[300], lost=2)
    readings[8] = replace(readings[8], length_mm=None, status="fault", said="signal lost")
    readings[9] = replace(readings[9], status="overrange", said="beyond its range")
    readings[10] = replace(readings[10], status="overrange", said="beyond its range")
    source = Script(readings)
    garbled = iter([{"checksum": 2}, {"checksum": 5, "bytes": 1}])
    workplace = assemble(Job(read_machine(MACHINE_FILE), plan, tmp_path / "session"), source, lambda: next(garbled))
    station = workplace.station
    told: list[events.Event] = []

    for observer in (source, told.append, accepts_ccw(station)):
        station.subscribe(observer)
    station.run()
    workplace.close()
    (run,) = read_session(tmp_path / "session").runs
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    text = run.path.read_text(encoding="utf-8")
    garbled_lines = "# rejected unreadable bytes: 1\n# rejected unreadable checksum: 3\n"
    rows = [line for line in text.splitlines() if line[0].isdigit()]
    assert run.counts == Counts(
        len(rows), 2, {"fault": 1, "overrange": 2, "unreadable bytes": 1, "unreadable checksum": 3}
    )
    assert completed.samples == len(rows)
    assert text.endswith(
        f"# received: {len(rows)}\n# lost: 2\n# rejected fault: 1\n# rejected overrange: 2\n{garbled_lines}"
    )
    assert read_run(run.path).header["lost"] == "2"


def test_a_disk_that_is_full_ends_the_run_with_its_cause_and_the_same_command_goes_on(
    plan_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = read_inline_plan(plan_file)
    readings = run_readings(plan.to_domain().tests["a"].circle, 1000.0)
    job = Job(read_machine(MACHINE_FILE), plan, tmp_path / "session")
    room = [20_000]
    write = RunWriter._write

    def limited(self: RunWriter, line: bytes) -> None:
        room[0] -= len(line)
        if room[0] < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(self, line)

    monkeypatch.setattr(RunWriter, "_write", limited)
    workplace = assemble(job, source := Script(readings))
    workplace.station.subscribe(source)
    told: list[events.Event] = []
    workplace.station.subscribe(told.append)
    workplace.station.send(Start())
    with pytest.raises(OutputError, match="no space left on device; free room on the disk"):
        workplace.station.run()
    workplace.close()
    assert [event.interrupted.label for event in told if isinstance(event, events.Fault)] == ["a-ccw-1"]
    (dead,) = read_session(job.folder).runs
    kept = read_run(dead.path)
    assert kept.warnings == ()
    assert len(kept.recording) > 500
    room[0] = 10_000_000
    workplace = assemble(job, source := Script(readings))
    station = workplace.station

    for observer in (source, accepts_ccw(station)):
        station.subscribe(observer)
    station.run()
    workplace.close()
    assert [(run.label, run.state.value) for run in read_session(job.folder).runs] == [
        ("a ccw 1", "recording"),
        ("a ccw 2", "accepted"),
    ]


def test_a_clock_that_was_stepped_back_does_not_turn_the_order_of_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = [100.0]
    now = time_of_day(lambda: seconds[0])
    first = now()

    class SteppedBack(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> datetime:
            return datetime.now(tz) - timedelta(hours=1)

    monkeypatch.setattr(storage, "datetime", SteppedBack)
    seconds[0] += 60.0
    assert now() - first == timedelta(seconds=60)
    assert time_of_day(lambda: seconds[0], last=first)() >= first


def test_what_is_noted_is_kept_with_its_time(plan_file: Path, tmp_path: Path) -> None:
    workplace = assemble(Job(read_machine(MACHINE_FILE), read_inline_plan(plan_file), tmp_path / "session"), Script())
    before = datetime.now(UTC)
    for command in (AddNote("a draught from the gate"), AddNote(ambient_temp_c=21.5), Quit()):
        workplace.station.send(command)
    workplace.station.run()
    workplace.close()
    notes = read_session(tmp_path / "session").notes
    assert [(note.text, note.ambient_temp_c) for note in notes] == [("a draught from the gate", None), ("", 21.5)]
    assert all(before - timedelta(seconds=1) <= note.made <= datetime.now(UTC) for note in notes)
    text = (tmp_path / "session" / "session.yaml").read_text(encoding="utf-8")
    assert text.startswith("format: dbb-session/1")
