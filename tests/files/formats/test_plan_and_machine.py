"""What plans and machines say becomes what calculations use."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.errors import InputError
from dbbstation.files.formats.machine import machine_data, read_machine
from dbbstation.files.formats.plan import plan_data, read_inline_plan, read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml.out import yaml_text
from dbbstation.machine.geometry import JointAxes, Rotation
from dbbstation.plan.plan import Direction

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.machine.geometry import Machine

FIXTURES = shipped_folder("fixtures")
PLANS = sorted((shipped_folder("protocols") / "plans").glob("*.yaml"))
EVERY_KEY = FIXTURES / "plans" / "every-key.yaml"


def same_machine(a: Machine, b: Machine) -> None:
    assert (a.name, a.travel, a.screw_lead_mm, a.masses) == (b.name, b.travel, b.screw_lead_mm, b.masses)
    assert (a.joint_tolerance_mm, a.compliance, a.strut_masses) == (b.joint_tolerance_mm, b.compliance, b.strut_masses)
    assert (a.joint_axes is None) == (b.joint_axes is None)
    if a.joint_axes is not None:
        assert np.array_equal(a.joint_axes.base, b.joint_axes.base)
        assert np.array_equal(a.joint_axes.platform, b.joint_axes.platform)
    assert a.hexapod.rotation is b.hexapod.rotation
    assert np.array_equal(a.hexapod.base_joints_mm, b.hexapod.base_joints_mm)
    assert np.array_equal(a.hexapod.platform_joints_mm, b.hexapod.platform_joints_mm)
    assert np.array_equal(a.reference_length_error_mm, b.reference_length_error_mm)


def test_every_key_of_a_machine_arrives() -> None:
    machine = read_machine(FIXTURES / "machines" / "every-key.yaml")
    assert machine.hexapod.rotation is Rotation.ZYX
    assert machine.hexapod.base_joints_mm.shape == (6, 3)
    assert machine.hexapod.platform_joints_mm[0, 2] == 500.0
    assert machine.travel.z_mm == (-1208.0, -808.0)
    assert machine.reference_length_error_mm.tolist() == [0.012, -0.034, 0.008, 0.021, -0.017, 0.005]
    assert (machine.screw_lead_mm, machine.joint_tolerance_mm) == (10.0, 0.05)
    assert asdict(machine.masses) == {"platform_kg": 400.0, "centre_of_gravity_above_tip_mm": 500.0}
    assert machine.compliance.at_1000mm_mm_per_n == 9.68e-6
    assert machine.strut_masses.screw_length_mm == 1400.0
    assert machine.joint_axes.base[4] == pytest.approx([-np.sin(np.radians(335)), np.cos(np.radians(335)), 0], abs=1e-6)
    assert machine.joint_axes.platform.shape == (6, 3)


@pytest.mark.parametrize("wrong", ["[0.0, 0.0, 0.0]", "[0.5, 0.5, 0.0]", "[64.1, 732.2, 0.0]"])
def test_an_axis_is_a_unit_vector(tmp_path: Path, wrong: str) -> None:
    text = (FIXTURES / "machines" / "every-key.yaml").read_text()
    assert text.count("[0.573576, 0.819152, 0.0]") == 1
    file = tmp_path / "machine.yaml"
    file.write_text(text.replace("[0.573576, 0.819152, 0.0]", wrong))
    with pytest.raises(InputError, match=r"joint_axes\.base\[3\].*(has the length 1|is not plausible)"):
        read_machine(file)


def test_the_reference_machine_is_the_one_of_the_papers(reference: Machine) -> None:
    def ring(radius_mm: float, angles_deg: list[float]) -> np.ndarray:
        return radius_mm * np.column_stack([np.cos(np.radians(angles_deg)), np.sin(np.radians(angles_deg))])

    base, platform = reference.hexapod.base_joints_mm, reference.hexapod.platform_joints_mm
    assert base[:, :2] == pytest.approx(ring(735.0, [95, 205, 215, 325, 335, 85]), abs=1e-8)
    assert platform[:, :2] == pytest.approx(ring(395.0, [140, 160, 260, 280, 20, 40]), abs=1e-8)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_machine_survives_writing_and_reading_to_the_last_bit(tmp_path_factory, reference, seed) -> None:
    rng = np.random.default_rng(seed)
    moved = reference.hexapod.moved(rng.normal(size=(6, 3)), rng.normal(size=(6, 3)))
    axes = rng.normal(size=(2, 6, 3))
    machine = replace(
        reference,
        hexapod=moved,
        reference_length_error_mm=rng.normal(size=6),
        joint_tolerance_mm=0.05,
        joint_axes=JointAxes(*(axes / np.linalg.norm(axes, axis=2, keepdims=True))),
    )
    path = tmp_path_factory.mktemp("machine") / "machine.yaml"
    path.write_text(yaml_text({"format": "dbb-machine/1", **machine_data(machine)}))
    same_machine(read_machine(path), machine)


@pytest.mark.parametrize("path", [*PLANS, EVERY_KEY], ids=lambda path: path.stem)
def test_shipped_plans_run_on_the_reference_machine(path: Path, reference: Machine) -> None:
    read_plan(path).check(reference)


@pytest.mark.parametrize("path", [*PLANS, EVERY_KEY], ids=lambda path: path.stem)
def test_a_plan_survives_writing_with_its_jig_inline(path: Path, tmp_path: Path) -> None:
    inline = read_inline_plan(path)
    (tmp_path / "plan.yaml").write_text(yaml_text(plan_data(inline)))
    assert read_plan(tmp_path / "plan.yaml") == inline.to_domain()


def test_the_plan_of_table_2_has_its_fifteen_positions() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    assert list(plan.tests) == list("abcdefghijklmno")
    levels = {-1150.0: "abcde", -1008.0: "fghij", -870.0: "klmno"}
    for z, names in levels.items():
        assert {plan.tests[name].circle.centre_mm[2] for name in names} == {z}
    tests = plan.tests
    assert [tests["j"].ball.bore, tests["j"].ball.centre_mm] == [1, (0.0, 100.0, -1008.0)]
    assert [tests["l"].ball.bore, tests["l"].circle.tilt_deg] == [4, (10.0, -10.0, 0.0)]
    # The tool leans towards the middle of the machine, whichever corner the ball stands at.
    for test in tests.values():
        x, y, _ = test.ball.centre_mm
        a, b, _ = test.circle.tilt_deg
        assert np.sign(a) == -np.sign(y)
        assert np.sign(b) == np.sign(x)
    assert {test.circle.bar_mm for test in tests.values()} == {150.0}
    assert tests["a"].ball.repeatability_mm == 0.58e-3
    assert tests["k"].ball.repeatability_mm == 1.85e-3
    assert all(test.directions == (Direction.CCW, Direction.CW) for test in tests.values())


def test_five_circles_of_the_elevated_plan_are_raised() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2-elevated.yaml")
    raised = [test for test in plan.tests.values() if test.circle.elevation_deg == 5.0]
    assert len(raised) == 5
    for test in raised:
        up = test.circle.centre_mm[2] - test.ball.centre_mm[2]
        assert up == pytest.approx(150.0 * math.sin(math.radians(5.0)))
        assert test.circle.radius_mm == pytest.approx(150.0 * math.cos(math.radians(5.0)))


def test_gravity_conditions_are_those_of_the_paper() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "gravity-conditions.yaml")
    assert list(plan.tests) == list("ABCDEFGHI")
    assert [test.circle.tilt_deg[0] for test in plan.tests.values()] == [-23, 0, 17, -25, -20, -10, 0, 10, 23]
    assert plan.tests["C"].circle.centre_mm == (-70.0, -70.0, -1008.0)
    assert plan.tests["B"].circle.tilt_deg == (0.0, 23.0, 0.0)
    assert {test.circle.bar_mm for test in plan.tests.values()} == {144.0}
    assert {test.ball.bore for test in plan.tests.values()} == {None}


def test_the_ten_minute_check_takes_ten_minutes() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    moving = sum(
        test.circle.swept_deg / test.circle.turning_deg_s * len(test.directions) for test in plan.tests.values()
    )
    assert 300 < moving < 480


def test_a_test_overrides_parts_of_the_path() -> None:
    plan = read_plan(EVERY_KEY)
    circle = plan.tests["short-bar"].circle
    assert (circle.bar_mm, circle.feed_mm_min, circle.start_deg) == (144.0, 2000.0, 90.0)
    assert (circle.overshoot_deg, circle.feed_in_mm, circle.direction) == (20.0, 1.0, Direction.CW)
    assert plan.tests["short-bar"].directions == (Direction.CW,)
    assert plan.tests["a"].circle.bar_mm == 150.0
    assert plan.repeat_at_end == ("a",)


def test_the_jig_frame_is_turned_and_moved_into_the_machine(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(
        "format: dbb-plan/1\nname: turned\npath: {radius_mm: 150, feed_mm_min: 1000}\n"
        "jig: {bores: {1: [100, 0]}, origin_in_machine_mm: [10, 20, -1150], rotation_about_z_deg: 90}\n"
        "holders: {short: {repeatability_um: 0.58}}\n"
        "balls: {b: {bore: 1, holder: short, centre_mm: [100, 5, 30], uncertainty_um: 0.8}}\n"
        "tests: [{name: a, ball: b}]\n"
    )
    ball = read_plan(path).tests["a"].ball
    # +X of the jig points along +Y of the machine.
    assert ball.centre_mm == pytest.approx((10.0 - 5.0, 20.0 + 100.0, -1120.0))
    assert (ball.uncertainty_mm, ball.repeatability_mm) == (0.8e-3, 0.58e-3)


def test_the_conventional_plan_has_the_places_of_table_2_and_balls_that_nobody_knows() -> None:
    folder = shipped_folder("protocols") / "plans"
    plan, on_the_plate = read_plan(folder / "conventional.yaml"), read_plan(folder / "table2.yaml")
    assert list(plan.tests) == list(on_the_plate.tests)
    for name, test in plan.tests.items():
        assert test.circle == on_the_plate.tests[name].circle
        assert test.directions == on_the_plate.tests[name].directions
        assert not test.ball.place_known
        assert (test.ball.bore, test.ball.holder, test.ball.plate) == (None, "", None)
    assert len({test.ball.name for test in plan.tests.values()}) == 15
    assert all(test.ball.place_known for test in on_the_plate.tests.values())


def test_a_ball_under_the_spindle_may_stand_beside_a_plate_and_is_placed_in_its_frame() -> None:
    tests = read_plan(EVERY_KEY).tests
    assert tests["conventional"].ball.centre_mm == (50.0, 50.0, -1008.0)
    assert [test.ball.place_known for test in tests.values()] == [True, True, True, False]


def test_the_usual_placing_is_not_written_down() -> None:
    assert "placed: cmm" not in yaml_text(plan_data(read_inline_plan(EVERY_KEY)))
    assert yaml_text(plan_data(read_inline_plan(EVERY_KEY))).count("placed: under-spindle") == 1
