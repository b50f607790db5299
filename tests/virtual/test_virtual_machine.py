from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.errors import MachineError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.toolpath import ToolpathBuilder
from dbbstation.plan.plan import Direction
from dbbstation.trace.analysis import figures
from dbbstation.trace.cut import cut
from dbbstation.trace.recording import Recording
from dbbstation.virtual.machine import Sizes, VirtualMachine, circle_path, path_of
from dbbstation.virtual.truth import random_kinematics

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan
    from dbbstation.virtual.machine import VirtualRun

EXACT = Sizes(noise_mm=0.0, bar_uncertainty_mm=0.0)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return read_plan(shipped_folder("protocols") / "plans" / "table2-elevated.yaml")


def recorded(run: VirtualRun, rate_hz: float = 100.0) -> Recording:
    t_s = np.arange(0.0, run.path.duration_s, 1.0 / rate_hz)
    return Recording("run", t_s, np.array([run.length_mm_at(float(t)) for t in t_s]))


@pytest.mark.parametrize("test", ["a", "b"])
@pytest.mark.parametrize("direction", list(Direction))
def test_the_path_of_a_run_is_the_one_that_the_format_describes(plan: Plan, test: str, direction: Direction) -> None:
    circle = plan.tests[test].run(direction)
    path = circle_path(circle)
    distance = np.linalg.norm(path.poses[:, :3] - np.array(circle.ball_mm), axis=1)
    assert distance[0] == pytest.approx(151.5)
    assert distance[-1] == pytest.approx(151.5)
    ends = circle.theta_deg(np.array([-45.0, 405.0]))
    np.testing.assert_allclose(path.poses[[0, -1]], circle.poses(ends, 1.5), atol=1e-9)
    on_arc = (path.t_s > 1.0 + 0.09 + 0.3 + 1e-6) & (path.t_s < path.duration_s - 1.39 - 1e-6)
    phi = 180.0 + (path.t_s[on_arc] - path.duration_s / 2.0) * circle.turning_deg_s
    np.testing.assert_allclose(path.poses[on_arc], circle.poses(circle.theta_deg(phi)), atol=1e-4)
    assert np.diff(path.t_s).min() > 0.0


def test_a_perfect_machine_runs_perfect_circles(reference: Machine, plan: Plan) -> None:
    exact = {
        name: replace(test, ball=replace(test.ball, uncertainty_mm=0.0, repeatability_mm=0.0))
        for name, test in plan.tests.items()
    }
    machine = VirtualMachine(MachineModel(reference), replace(plan, tests=exact), sizes=EXACT)
    for test in ("a", "b"):
        raw = cut(recorded(machine.run(test, Direction.CW)), plan.tests[test].run(Direction.CW))
        # The chords of the commanded polygon lie up to 0.06 µm inside the circle.
        assert np.abs(raw.length_mm - 150.0).max() < 1e-4


def test_a_recording_of_it_is_cut_where_the_machine_was(reference: Machine, plan: Plan) -> None:
    machine = VirtualMachine(MachineModel(reference, random_kinematics(reference, 4)), plan, seed=4, sizes=EXACT)
    run = machine.run("d", Direction.CCW)
    circle = plan.tests["d"].circle
    raw = cut(recorded(run), circle)
    t_s = run.path.duration_s / 2.0 + (raw.phi_deg - 180.0) / circle.turning_deg_s
    off = raw.length_mm - np.interp(t_s, run.path.t_s, run.length_mm)
    assert np.abs(off).max() < 0.3e-3
    assert figures(raw).circularity_um > 10.0


def test_a_seed_makes_the_same_machine_again(reference: Machine, plan: Plan) -> None:
    def lengths(seed: int) -> np.ndarray:
        machine = VirtualMachine(MachineModel(reference, random_kinematics(reference, seed)), plan, seed=seed)
        machine.run("c", Direction.CCW)
        return machine.run("a", Direction.CCW).length_mm

    np.testing.assert_array_equal(lengths(5), lengths(5))
    assert np.abs(lengths(5) - lengths(6)).max() > 0.01


def test_mountings_shift_by_as_much_as_the_plan_states(reference: Machine, plan: Plan) -> None:
    machine = VirtualMachine(MachineModel(reference), plan, seed=1, sizes=EXACT)
    shifts = []
    for _ in range(300):
        number = machine.mount(plan.tests["f"].ball)
        machine.run("f", Direction.CCW)
        told = {source["shared"]: source for source in machine.describe()["sources"]}
        shifts.append(list(told[f"mounting {number}"]["parameters"].values()))
    assert np.std(shifts) == pytest.approx(plan.tests["f"].ball.repeatability_mm, rel=0.1)
    balls = [source for source in machine.describe()["sources"] if source["name"] == "ball-coordinate"]
    assert len(balls) == 1


def test_both_directions_share_a_mounting_and_another_ball_is_put_up(reference: Machine, plan: Plan) -> None:
    machine = VirtualMachine(MachineModel(reference), plan)
    runs = [machine.run(test, direction) for test in ("a", "b") for direction in Direction]
    assert [run.mounting for run in runs] == [1, 1, 2, 2]


def test_a_run_that_the_plan_does_not_have_is_refused(reference: Machine, plan: Plan) -> None:
    with pytest.raises(MachineError, match="no run zz ccw"):
        VirtualMachine(MachineModel(reference), plan).run("zz", Direction.CCW)


def test_of_a_program_the_part_between_its_pauses_is_run(plan: Plan) -> None:
    circle = plan.tests["a"].circle
    with_approach, without = circle_toolpath(circle, "a"), circle_toolpath(circle, "a", clearance_mm=None)
    path, bare = path_of(with_approach), path_of(without)
    assert path.duration_s == pytest.approx(bare.duration_s, abs=1e-6)
    at = np.linspace(0.0, bare.duration_s, 500)
    for axis in range(6):
        np.testing.assert_allclose(
            np.interp(at, path.t_s, path.poses[:, axis]), np.interp(at, bare.t_s, bare.poses[:, axis]), atol=1e-6
        )


def test_a_program_that_does_not_move_is_refused() -> None:
    still = ToolpathBuilder("still.ngc", np.zeros(6))
    still.dwell(1.0)
    with pytest.raises(MachineError, match="does not move"):
        path_of(still.built())
