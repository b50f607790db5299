"""Balls put up under the spindle stand at the actual tool tip, off by what a hand leaves [CAL III-A]."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.trace.analysis import figures
from dbbstation.trace.recording import RawCircle
from dbbstation.virtual.machine import Sizes, VirtualMachine
from dbbstation.virtual.truth import SET_UP_MM, SetUp, random_kinematics
from tests.virtual.brute_force import tool

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan
    from dbbstation.virtual.machine import VirtualRun

EXACT = Sizes(noise_mm=0.0, bar_uncertainty_mm=0.0)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return read_plan(shipped_folder("protocols") / "plans" / "conventional.yaml")


def raw(run: VirtualRun, plan: Plan) -> RawCircle:
    circle = plan.tests[run.test].run(run.direction)
    phi = np.arange(0.0, 360.0, 2.0)
    t_s = run.path.duration_s / 2.0 + (phi - 180.0) / circle.turning_deg_s
    return RawCircle(run.test, circle, t_s, phi, np.interp(t_s, run.path.t_s, run.length_mm))


@pytest.mark.parametrize("test", ["d", "g"])
def test_readings_are_those_of_brute_force(reference: Machine, plan: Plan, test: str) -> None:
    truth = MachineModel(reference, random_kinematics(reference, 21))
    machine = VirtualMachine(truth, plan, seed=21, sizes=EXACT)
    runs = [machine.run(test, direction) for direction in Direction]
    (told,) = machine.describe()["set_up_errors"]
    assert (told["ball"], told["mounting"]) == (test, 1)
    circle = plan.tests[test].circle
    tip, _ = tool(truth, np.array([*circle.ball_mm, *circle.tilt_deg]))
    ball = tip + np.array(told["fixed_ball_um"]) / 1e3
    for run in runs:
        for k in range(0, len(run.path.poses), len(run.path.poses) // 12):
            tip, turn = tool(truth, run.path.poses[k])
            length = np.linalg.norm(tip + turn @ np.array(told["moving_ball_um"]) / 1e3 - ball)
            assert run.length_mm[k] == pytest.approx(length, abs=1e-7)


def test_the_machines_own_position_error_does_not_show(reference: Machine, plan: Plan) -> None:
    """All base joints moved alike, and the ball with them: nothing to be seen, as [CAL III-A-2] says."""
    moved = Fitted(known_sources()["base-joints"], np.tile([0.3, -0.2, 0.1], 6))
    by_hand_alone = replace(EXACT, set_up_mm=0.0)
    run = VirtualMachine(MachineModel(reference, (moved,)), plan, sizes=by_hand_alone).run("l", Direction.CW)
    still = VirtualMachine(MachineModel(reference), plan, sizes=by_hand_alone).run("l", Direction.CW)
    np.testing.assert_allclose(run.length_mm, still.length_mm, atol=1e-9)


def test_the_centre_is_that_of_the_set_up(reference: Machine, plan: Plan) -> None:
    machine = VirtualMachine(MachineModel(reference), plan, seed=2, sizes=EXACT)
    seen = figures(raw(machine.run("a", Direction.CCW), plan))
    (told,) = machine.describe()["set_up_errors"]
    between = np.array(told["moving_ball_um"]) - np.array(told["fixed_ball_um"])
    assert np.array(seen.centre_mm) * 1e3 == pytest.approx(between[:2], abs=0.05)
    assert seen.circularity_um < 0.1


def test_both_directions_share_a_set_up_and_the_next_mounting_has_another(reference: Machine, plan: Plan) -> None:
    machine = VirtualMachine(MachineModel(reference), plan, seed=3, sizes=EXACT)
    first = [figures(raw(machine.run("b", direction), plan)).centre_mm for direction in Direction]
    assert first[0] == pytest.approx(first[1], abs=1e-6)
    machine.mount(plan.tests["b"].ball)
    again = figures(raw(machine.run("b", Direction.CCW), plan)).centre_mm
    assert np.hypot(again[0] - first[0][0], again[1] - first[0][1]) > 0.005
    assert [entry["mounting"] for entry in machine.describe()["set_up_errors"]] == [1, 2]


def test_set_ups_scatter_as_stated_and_are_read_as_a_micrometer_does() -> None:
    rng = np.random.default_rng(5)
    balls = [SetUp.drawn(rng, SET_UP_MM) for _ in range(500)]
    fixed = np.array([one.fixed_ball_mm for one in balls])
    assert fixed.std() == pytest.approx(SET_UP_MM, rel=0.06)
    assert np.abs(np.corrcoef(np.hstack([fixed, [one.moving_ball_mm for one in balls]]).T) - np.eye(6)).max() < 0.15
    read = [one.read(rng, 0.001) for one in balls]
    off = np.array(
        [
            (r.fixed_ball_mm - b.fixed_ball_mm, r.moving_ball_mm - b.moving_ball_mm)
            for r, b in zip(read, balls, strict=True)
        ]
    )
    assert off.std() == pytest.approx(0.001, rel=0.06)
    assert {one.uncertainty_mm for one in read} == {0.001}
