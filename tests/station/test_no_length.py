"""What an instrument says instead of a length, from its wire into the recording's status column."""

from __future__ import annotations

import csv
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.codec import decode, encode
from dbbstation.instrument.library import load_instrument
from dbbstation.station import events
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Accept, Quit, Reject, Start
from dbbstation.station.states import State
from tests.station.bench import MACHINE_FILE
from tests.station.readings import run_readings
from tests.station.test_engine import Script

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading

GAUGE = load_instrument("sylvac-opto-rs")


def heard(protocol: Protocol, told: Reading, raw: bytes | None = None) -> Reading:
    return replace(decode(protocol, raw or encode(protocol, told.length_mm)), t_s=told.t_s)


def recorded(plan_file: Path, folder: Path, errors: dict[int, bytes]) -> tuple[list[str], list[events.RunCompleted]]:
    """Measure the first run over the gauge's wire, with errors in place of some replies; return statuses and results."""
    plan = read_inline_plan(plan_file)
    perfect = run_readings(plan.to_domain().tests["a"].circle, 1000.0)
    source = Script([heard(GAUGE, one, errors.get(place)) for place, one in enumerate(perfect)])
    workplace = assemble(Job(read_machine(MACHINE_FILE), plan, folder), source)
    station = workplace.station
    completed: list[events.RunCompleted] = []

    def judge(event: events.Event) -> None:
        if isinstance(event, events.RunCompleted):
            completed.append(event)
        elif isinstance(event, events.StateChanged) and event.state is State.COMPLETE:
            station.send(Accept())
        elif isinstance(event, events.StateChanged) and event.state is State.FLAWED:
            station.send(Reject("no length"))
        elif isinstance(event, events.RunAnnounced):
            station.send(Quit() if completed else Start())

    for observer in (source, judge):
        station.subscribe(observer)
    station.run()
    workplace.close()
    (run,) = read_session(folder).runs
    lines = [line for line in run.path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [row["status"] for row in csv.DictReader(lines)], completed


@pytest.mark.parametrize(("raw", "status"), [(b"ERR0\r", "fault"), (b"ERR3\r", "overrange")])
def test_in_the_dwells_it_stands_in_the_status_column(plan_file: Path, tmp_path: Path, raw: bytes, status: str) -> None:
    """OPTO-RS: ERR0 is the sensor, ERR3 the measuring range."""
    statuses, completed = recorded(plan_file, tmp_path / "session", {5: raw, 6: raw})
    assert statuses.count(status) == 2
    assert set(statuses) == {"ok", status}
    assert completed[0].problem == ""
    assert completed[0].figures is not None


@pytest.mark.parametrize(
    ("raw", "said"),
    [(b"ERR0\r", "fault (sensor error)"), (b"ERR3\r", "overrange (beyond the measuring range)")],
)
def test_on_the_turn_it_is_the_last_line_of_the_run_and_the_message(
    plan_file: Path, tmp_path: Path, raw: bytes, said: str
) -> None:
    statuses, completed = recorded(plan_file, tmp_path / "session", {700: raw})
    assert statuses[-1] == said.split(" ", maxsplit=1)[0]
    assert set(statuses[:-1]) == {"ok"}
    assert completed[0].figures is None
    assert completed[0].problem.startswith(f"the instrument reports {said} at ")
    assert completed[0].problem.endswith("then repeat the run")
