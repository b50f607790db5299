"""What the circles can see of the machine, and what kinematic parameters can hide.

The expected numbers come from another program by other hands, written from the same equations; the 23 parameters are
also those of [CAL V], and the six that centre removal costs those of [CAL III-A].
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.bar import BarDrift, BarOffset
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.mechanisms.set_up import ToolBallOffset
from tests.plant.mechanisms.thermal import JigThermal, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Warming
from tests.plant.mechanisms.weights import BaseCompliance, StrutWeight
from tests.plant.plan import elevated, subset, table_ii_plan
from tests.plant.sensitivity import (
    WITH_PLATFORM,
    concealed_share,
    kinematic_matrix,
    left_by,
    readings,
    visible_directions,
)
from tests.plant.session import true_runs

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray

PLAN = table_ii_plan(scatter_mm=0.0)
STEADY = Warming(rise_k=100.0, time_constant_s=1e6)
"""So slow a warm-up that growth over the session is a straight line in time."""


@pytest.fixture(scope="module")
def matrix() -> FloatArray:
    return kinematic_matrix(PLAN, WITH_PLATFORM)


@pytest.fixture(scope="module")
def perfect() -> FloatArray:
    return readings(PLAN)


def rms_um(values_mm: FloatArray) -> float:
    return 1000.0 * float(np.sqrt(np.mean(values_mm**2)))


def test_level_circles_lose_the_height_of_the_base(matrix: FloatArray) -> None:
    kinematic = matrix[:, :24]
    assert visible_directions(kinematic) == 23
    common_z = np.zeros(24)
    common_z[8::3] = 1.0
    assert np.abs(kinematic @ common_z).max() < 1e-7


def test_removing_the_centres_loses_six(matrix: FloatArray) -> None:
    pieces = []
    begin = 0
    for run in true_runs(PLAN, [], rate_hz=2.0):
        angle_rad = np.radians(run.theta_deg[run.in_circle])
        rows = matrix[begin : begin + len(angle_rad), :24]
        begin += len(angle_rad)
        centre = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
        pieces.append(rows - centre @ np.linalg.lstsq(centre, rows, rcond=None)[0])
    assert visible_directions(np.concatenate(pieces)) == 18


def test_one_height_loses_three() -> None:
    level = replace(PLAN, balls=tuple(replace(ball, centre_mm=(*ball.centre_mm[:2], 142.0)) for ball in PLAN.balls))
    assert visible_directions(kinematic_matrix(level)) == 21


@pytest.mark.parametrize("names", ["abcde", pytest.param("klmno", marks=pytest.mark.nightly)])
def test_raising_the_bar_in_five_tests_shows_everything(names: str) -> None:
    raised = kinematic_matrix(elevated(PLAN, 5.0, names))
    assert visible_directions(raised) == 24
    assert 248.5 < np.linalg.cond(raised) < 252.5


@pytest.mark.parametrize(
    ("mechanism", "percent", "within"),
    [
        (Gravity(), 91, 0.5),
        (ThermalStruts(STEADY), 95, 0.5),
        (ThermalFrame(STEADY), 96, 0.5),
        (BarOffset(10.0), 65, 0.5),
        (BarDrift(STEADY), 79, 0.5),
        (ScrewCyclic(), 1, 2.0),
        (Backlash(), 0, 1.0),
        (ServoLag((0.0, 0.0, 2.0, 0.0, 0.0, 0.0)), 0, 1.0),
    ],
    ids=lambda value: value.name if isinstance(value, Mechanism) else None,
)
def test_kinematic_parameters_conceal(
    mechanism: Mechanism, percent: float, within: float, matrix: FloatArray, perfect: FloatArray
) -> None:
    signature_mm = readings(PLAN, [mechanism]) - perfect
    assert 100 * concealed_share(matrix[:, :24], signature_mm) == pytest.approx(percent, abs=within)


def test_platform_joints_hide_behind_base_joints(matrix: FloatArray) -> None:
    kinematic, platform = matrix[:, :24], matrix[:, 24:]
    left = np.stack([left_by(kinematic, column) for column in platform.T])
    assert 1.0 - (left**2).sum() / (platform**2).sum() == pytest.approx(0.99, abs=0.01)


def test_gravity_leaves_little_for_the_eye(matrix: FloatArray, perfect: FloatArray) -> None:
    signature_mm = readings(PLAN, [Gravity()]) - perfect
    assert rms_um(signature_mm) == pytest.approx(15.1, rel=0.02)
    assert rms_um(left_by(matrix[:, :24], signature_mm)) == pytest.approx(4.5, rel=0.02)


def test_repeating_three_circles_uncovers_growth() -> None:
    plan = replace(PLAN, repeat_at_end=("a", "f", "k"))
    signature_mm = readings(plan, [ThermalStruts(STEADY)]) - readings(plan)
    assert 100 * concealed_share(kinematic_matrix(plan), signature_mm) == pytest.approx(86, abs=0.5)


def test_a_tool_ball_offset_is_a_common_shift_of_the_platform_joints(matrix: FloatArray, perfect: FloatArray) -> None:
    offset_mm = np.array([0.01, -0.02, 0.005])
    signature_mm = readings(PLAN, [ToolBallOffset((0.01, -0.02, 0.005))]) - perfect
    # The joints seen from the ball moved the other way.
    expected_mm = -matrix[:, 24:] @ np.tile(offset_mm, 6)
    np.testing.assert_allclose(signature_mm, expected_mm, atol=2e-6)


def test_strut_weights_pass_for_gravity(matrix: FloatArray, perfect: FloatArray) -> None:
    bent = readings(PLAN, [Gravity()])
    known = np.column_stack([matrix[:, :24], 1000.0 * (bent - perfect)])
    # Strut weights show only where struts give way.
    assert concealed_share(known, readings(PLAN, [Gravity(), StrutWeight()]) - bent) > 0.999


def test_a_frame_that_gives_way_along_the_struts_passes_for_gravity(matrix: FloatArray, perfect: FloatArray) -> None:
    bar = readings(PLAN, [BarOffset(1000.0)]) - perfect
    known = np.column_stack([matrix[:, :24], bar])
    frame = left_by(known, readings(PLAN, [BaseCompliance((1e-6, 1e-6, 1e-6))]) - perfect)
    gravity = left_by(known, readings(PLAN, [Gravity()]) - perfect)
    likeness = (frame @ gravity) ** 2 / ((frame @ frame) * (gravity @ gravity))
    assert likeness == pytest.approx(0.96, abs=0.01)


@pytest.mark.parametrize("strut", range(6))
def test_the_lead_error_of_one_screw_is_concealed(strut: int, matrix: FloatArray, perfect: FloatArray) -> None:
    error_um_m = [0.0] * 6
    error_um_m[strut] = 20.0
    # Zero where the platform is at home: there all struts are 737 mm long.
    lead = ScrewLead((*error_um_m,), zero_mm=737.0)  # type: ignore[arg-type]
    assert 0.925 < concealed_share(matrix[:, :24], readings(PLAN, [lead]) - perfect) < 0.965


def test_a_warm_jig_moves_the_corner_bores_as_its_expansion_says() -> None:
    plan = subset(PLAN, ["b"])
    (warm, _), (cold, _) = true_runs(plan, [JigThermal(1.0)]), true_runs(plan, [])
    angle_rad = np.radians(cold.theta_deg[cold.in_circle])
    harmonics = np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=1)
    # The bar shortens on the side to which the ball moves: 1.6 µm outwards, 141.4 mm from the middle at 11.5 µm/m.
    shift_um = -1000.0 * np.linalg.lstsq(harmonics, (warm.length_mm - cold.length_mm)[cold.in_circle], rcond=None)[0]
    np.testing.assert_allclose(shift_um, [-1.15, -1.15], atol=0.01)
