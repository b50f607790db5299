"""Signatures to first order against differences of the whole simulation, which searches for every pose."""

from __future__ import annotations

import numpy as np
import pytest

from tests.plant.arrays import FloatArray
from tests.plant.linear import LinearSession
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.balls import BallCoordinates
from tests.plant.mechanisms.bar import BarDrift
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.gravity import CentreOfGravityShift, Gravity
from tests.plant.mechanisms.joints import JointFriction, JointRunout
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.mechanisms.servo import TimeSkew
from tests.plant.mechanisms.set_up import ToolBallOffset
from tests.plant.mechanisms.thermal import SpindleGrowth, ThermalFrame
from tests.plant.mechanisms.weights import BaseCompliance, StrutWeight
from tests.plant.plan import Path, elevated, subset, table_ii_plan
from tests.plant.sensitivity import kinematic_matrix
from tests.plant.session import scene_of, simulate_run

PLAN = elevated(subset(table_ii_plan(3), ["a", "h", "m"]), 5.0, ["m"])
WRONG = Kinematics(base_mm=np.tile([0.05, -0.02, 0.0], (6, 1)))


@pytest.fixture(scope="module")
def session() -> LinearSession:
    return LinearSession(scene_of(PLAN), 120)


def simulated(session: LinearSession, mechanisms: list[Mechanism]) -> FloatArray:
    parts = []
    for course in session.courses:
        rate_hz = 1.0 / float(np.diff(course.motion.session_s[:2])[0])
        run, _ = simulate_run(session.scene, course.slot, mechanisms, rate_hz)
        parts.append(run.length_mm[: len(course.kept)][course.kept])
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("mechanism", "carriers"),
    [
        (Gravity(1e-6), []),
        (CentreOfGravityShift((2.0, 0.0, 5.0)), [Gravity(1e-6)]),
        (StrutWeight(), [Gravity(1e-6)]),
        (BaseCompliance((1e-7, 1e-7, 3e-7)), []),
        (Backlash((4.0, 0.0, 2.0, 0.0, 0.0, 0.0)), []),
        (JointFriction(), []),
        (JointRunout(np.full((6, 3), 5.0), np.full((6, 3), 3.0)), []),
        (ThermalFrame(), []),
        (SpindleGrowth(), []),
        (BarDrift(), []),
        (BallCoordinates({"5-long": np.array([3.0, 0.0, 2.0])}), []),
        (ToolBallOffset((0.005, -0.01, 0.003)), []),
        (TimeSkew(20.0), [WRONG]),
    ],
    ids=lambda value: value.name if isinstance(value, Mechanism) else None,
)
def test_first_order_is_what_small_errors_do(
    session: LinearSession, mechanism: Mechanism, carriers: list[Mechanism]
) -> None:
    expected_mm = simulated(session, [*carriers, mechanism]) - simulated(session, carriers)
    signature_mm = session.change(mechanism, carriers)
    assert np.abs(signature_mm - expected_mm).max() < 0.01 * np.abs(expected_mm).max() + 2e-6


def test_columns_of_joints_are_those_of_finite_differences() -> None:
    # A turn takes 56 s: 112 samples are those of 2 Hz, less the ramps.
    plan = subset(table_ii_plan(3, Path(feed_mm_min=2 * np.pi * 150.0 * 60.0 / 60.0)), ["a", "h", "m"])
    session = LinearSession(scene_of(plan), 120)
    both = np.concatenate([session.kinematic, session.platform_joints], axis=1)
    np.testing.assert_allclose(both, kinematic_matrix(plan, 42), atol=1e-6)


def test_struts_one_by_one_add_up(session: LinearSession) -> None:
    each = session.by_strut(Backlash())
    assert each.shape == (len(session.signature([])), 6)
    np.testing.assert_allclose(each.sum(axis=1), session.signature([Backlash()]), atol=1e-12)
