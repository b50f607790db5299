"""A session of many tests with mishaps: each is found, measured again, and nothing is lost over faults."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.reading import Reading
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.station import events
from dbbstation.station.assembly import Job, Workplace, assemble
from dbbstation.station.commands import Accept, Judge, Quit, Reject, Repeat, Start
from dbbstation.station.states import State
from dbbstation.trace.analysis import CircleFigures
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.station.bench import MACHINE_FILE

if TYPE_CHECKING:
    from pathlib import Path

RATE_HZ = 10.0
CCW, CW = Direction.CCW, Direction.CW

Spoilt = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""What times [s] and lengths [mm] of a run become."""


def bump(t_s: np.ndarray, length_mm: np.ndarray) -> np.ndarray:
    """60 µm over about five degrees, in the middle of the turn."""
    return length_mm + 0.06 * np.exp(-0.5 * ((t_s - t_s.mean()) / 0.4) ** 2)


def longer(_t_s: np.ndarray, length_mm: np.ndarray) -> np.ndarray:
    return length_mm + 0.3


class Shop:
    """A machine and somebody beside it: readings for the station, commands by what it says.

    Args:
        folder: of the session.
        seed: of the machine.
        tests: of the plan of fifteen.
    """

    def __init__(self, folder: Path, seed: int, tests: str) -> None:
        machine = read_machine(MACHINE_FILE)
        text = (shipped_folder("protocols") / "plans" / "table2-elevated.yaml").read_text(encoding="utf-8")
        kept = [line for line in text.splitlines() if line[:11] != "  - {name: " or line[11] in tests]
        folder.with_suffix(".yaml").write_text("\n".join(kept) + "\n", encoding="utf-8")
        plan = read_inline_plan(folder.with_suffix(".yaml"))
        self.job = Job(machine, plan, folder)
        self.virtual = VirtualMachine(
            MachineModel(machine, random_kinematics(machine, seed)), plan.to_domain(), seed=seed
        )
        self.spoilt: dict[str, Spoilt] = {}
        self.runs_instead: dict[str, tuple[str, Direction]] = {}
        self.reject: set[str] = set()
        self.pull_at: str = ""
        self.leave_at: str = ""
        self.found: dict[str, list[str]] = {}
        self.figures: dict[str, CircleFigures | None] = {}
        self.revoke: list[str] = []
        self.offered: list[str] = []
        self._now_s = 0.0
        self._readings: list[Reading] = []
        self._error: InstrumentError | None = None
        self._announced: events.RunAnnounced | None = None
        self.workplace: Workplace | None = None

    def measure(self) -> State:
        """Run until the plan is through, a fault comes or somebody leaves."""
        self._readings, self._error = [], None
        self.workplace = assemble(self.job, self)
        self.workplace.station.subscribe(self)
        try:
            return self.workplace.station.run()
        except InstrumentError:
            return State.FAULTED
        finally:
            self.workplace.close()

    def drain(self) -> list[Reading]:
        readings, self._readings = self._readings, []
        if not readings and self._error is not None:
            raise self._error
        return readings

    def __call__(self, event: events.Event) -> None:
        send = self.workplace.station.send
        match event:
            case events.RunAnnounced():
                self._announced = event
            case events.RunRestored():
                self.offered.append(event.run.label)
            case events.RunCompleted():
                self.figures[event.run.label] = event.figures
                self.found[event.run.label] = [str(finding.name) for finding in event.wrong]
            case events.StateChanged(state=State.ANNOUNCED):
                if self.revoke:
                    test, direction, repeat = self.revoke.pop().split("-")
                    send(Judge(test, Direction(direction), int(repeat), accepted=False, reason="seen later"))
                else:
                    send(Start())
            case events.StateChanged(state=State.ARMED):
                self._run(self._announced.run)
            case events.StateChanged(state=State.COMPLETE | State.FLAWED):
                send(self._verdict(self._announced.run.label))

    def _verdict(self, label: str) -> Accept | Repeat | Reject | Quit:
        if label == self.leave_at:
            self.leave_at = ""
            return Quit()
        if label in self.reject:
            return Reject("a person walked by")
        return Repeat(", ".join(self.found[label])) if self.found[label] else Accept()

    def _run(self, run: events.RunId) -> None:
        test, direction = self.runs_instead.get(run.label, (run.test, run.direction))
        made = self.virtual.run(test, direction)
        t_s = np.arange(0.0, made.path.duration_s + 1.0, 1.0 / RATE_HZ)
        length_mm = np.array([made.length_mm_at(float(t)) + self.virtual.noise_mm() for t in t_s])
        spoil = self.spoilt.get(run.label)
        if spoil is not None:
            length_mm = spoil(t_s, length_mm)
        if run.label == self.pull_at:
            self.pull_at, t_s = "", t_s[: len(t_s) // 2]
            self._error = InstrumentError("the cable was pulled", where="here")
        self._readings = [
            Reading(self._now_s + float(t), float(value)) for t, value in zip(t_s, length_mm, strict=False)
        ]
        self._now_s += made.path.duration_s + 10.0


@pytest.mark.parametrize(
    ("seed", "tests"),
    [(5, "bcdefghikm"), *(pytest.param(seed, "abcdefghijklmno", marks=pytest.mark.nightly) for seed in (5, 6))],
)
def test_tests_with_every_mishap(tmp_path: Path, seed: int, tests: str) -> None:
    shop = Shop(tmp_path / "session", seed, tests)
    shop.runs_instead = {"d-cw-1": ("d", CCW), "i-ccw-1": ("f", CCW)}
    shop.spoilt = {"e-ccw-1": longer, "g-cw-1": bump}
    shop.reject = {"h-ccw-1"}
    shop.pull_at, shop.leave_at = "c-cw-1", "k-ccw-1"
    assert shop.measure() is State.FAULTED
    assert shop.measure() is State.STOPPED
    # What was complete when somebody left is offered, judged as it was, and a verdict given earlier is taken back.
    shop.revoke = ["b-ccw-1"]
    assert shop.measure() is State.FINISHED
    assert shop.offered == ["k-ccw-1"]
    found = {label: names for label, names in shop.found.items() if names}
    assert "radius" in found.pop("e-ccw-1")
    assert "bump" in found.pop("g-cw-1")
    assert "direction" in found.pop("d-cw-1")
    # The whole circle of f in place of i lies where i's may lie, as far as the nominal machine knows; f's own run tells.
    assert "test" in found.pop("i-ccw-1")
    # Sound circles: one false alarm in a thousand runs.
    assert found == {}
    again = assemble(shop.job, shop)
    again.close()
    known = again.judge.known()
    from_disk = {one.completed.run.label: one.completed for one in known if one.accepted}
    assert len(from_disk) == 2 * len(tests)
    assert {one.completed.run.label for one in known if not one.accepted} == {
        "b-ccw-1",
        "d-cw-1",
        "e-ccw-1",
        "g-cw-1",
        "h-ccw-1",
        "i-ccw-1",
    }
    assert all(one.reason for one in known if not one.accepted)
    # Figures and findings are those that were told when the runs were measured.
    assert {label: [str(f.name) for f in one.wrong] for label, one in from_disk.items() if one.wrong} == {}
    for label, one in from_disk.items():
        assert one.figures.centre_mm == pytest.approx(shop.figures[label].centre_mm, abs=2e-6)
    session = read_session(shop.job.folder)
    rejected = {run.label for run in session.in_state(RunState.REJECTED)}
    assert rejected == {"b ccw 1", "d cw 1", "e ccw 1", "g cw 1", "h ccw 1", "i ccw 1"}
    assert [run.label for run in session.in_state(RunState.RECORDING)] == ["c cw 1"]
    accepted = Counter((run.test, run.direction) for run in session.in_state(RunState.ACCEPTED))
    assert accepted == Counter((test, direction) for test in session.plan.tests for direction in Direction)
