"""An operator who ran two programs the wrong way about is led back, and not left blaming a right circle."""

from __future__ import annotations

import asyncio
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.reading import Reading
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.service.board import SequenceOpened
from dbbstation.service.runner import Runner
from dbbstation.station import events
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.engine import Station
from dbbstation.station.states import VERDICT, State
from dbbstation.tui.app import StationApp
from dbbstation.tui.board_screen import Shown
from dbbstation.tui.operator_screens import OperateScreen
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.station.bench import MACHINE_FILE

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

RATE_HZ = 10.0
INSTEAD = {"low": "side", "side": "low"}
"""Which program runs where the first run of a test is asked for."""


class Machine:
    """Readings of the machine at which the operator runs the wrong programs first."""

    def __init__(self, folder: Path) -> None:
        machine = read_machine(MACHINE_FILE)
        plan = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
        self.job = Job(machine, plan, folder)
        self._virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, 3)), plan.to_domain(), seed=3)
        self._readings: list[Reading] = []
        self._now_s = 0.0
        self._announced: events.RunAnnounced | None = None

    @contextmanager
    def open(self) -> Iterator[tuple[Station, SequenceOpened]]:
        workplace = assemble(self.job, self)
        workplace.station.subscribe(self)
        try:
            known, schedule = workplace.judge.known(), workplace.schedule
            yield workplace.station, SequenceOpened(schedule.tasks, schedule.open, str(self.job.folder), known)
        finally:
            workplace.close()

    def drain(self) -> list[Reading]:
        readings, self._readings = self._readings, []
        return readings

    def __call__(self, event: events.Event) -> None:
        if isinstance(event, events.RunAnnounced):
            self._announced = event
        if isinstance(event, events.StateChanged) and event.state is State.ARMED:
            run = self._announced.run
            test = INSTEAD.get(run.test, run.test) if run.repeat == 1 else run.test
            made = self._virtual.run(test, run.direction)
            for t_s in np.arange(0.0, made.path.duration_s + 1.0, 1.0 / RATE_HZ).tolist():
                length_mm = made.length_mm_at(t_s) + self._virtual.noise_mm()
                self._readings.append(Reading(self._now_s + t_s, length_mm))
            self._now_s += made.path.duration_s + 10.0


@pytest.mark.parametrize("operated", [False, True])
def test_two_wrong_programs_lead_back_to_their_tests(tmp_path: Path, *, operated: bool) -> None:
    machine = Machine(tmp_path / "session")
    plan = machine.job.plan.to_domain()
    shown = Shown(plan.name, tests=plan.tests)
    runner = Runner(machine.open)
    app = StationApp(shown, runner)
    said: list[str] = []

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            if operated:
                app.push_screen(OperateScreen(app, shown))
            end_s = time.monotonic() + 120.0
            while app.board.state is not State.FINISHED:
                assert time.monotonic() < end_s, (app.board.state, said)
                app.look()
                if app.board.state in {State.ANNOUNCED, *VERDICT}:
                    before = app.board.state, app.board.announced
                    if app.board.state in VERDICT:
                        said.append(" ".join(str(app.screen.query_one("#now").visual).split()))
                    await pilot.press("enter")
                    while (app.board.state, app.board.announced) == before and time.monotonic() < end_s:
                        await asyncio.sleep(0.01)
                        app.look()
                await asyncio.sleep(0.01)

    asyncio.run(run())
    back = [text for text in said if "Enter goes back to test low" in text]
    assert len(back) == 1
    assert "low-ccw-1, low-cw-1, side-ccw-1, side-cw-1 must be measured again: it is the circle of side ccw." in back[0]
    assert "GOOD high-ccw-1" in back[0]
    session = read_session(machine.job.folder)
    accepted = sorted(run.label for run in session.in_state(RunState.ACCEPTED))
    assert accepted == sorted(
        [f"high {way} 1" for way in Direction] + [f"{test} {way} 2" for test in INSTEAD for way in Direction]
    )
    rejected = session.in_state(RunState.REJECTED)
    assert len(rejected) == 4
    assert all("by all 5 circles together it is the circle of" in run.reason for run in rejected)
