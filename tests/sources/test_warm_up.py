"""Struts, frame, spindle and bar that warm up, against the law's own definition and what circles can see of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dbbstation.errors import ModelError
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.rotation import Frames
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.bar_drift import BarDrift
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.platform_joints import PlatformJoints
from dbbstation.sources.spindle_growth import SpindleGrowth
from dbbstation.sources.thermal_frame import ThermalFrame
from dbbstation.sources.thermal_struts import ThermalStruts
from dbbstation.sources.warm_up import TIME_CONSTANTS_S, warmed
from tests.sources.runs import concealed_share, jig_runs, random_run, run

STRUTS, FRAME, SPINDLE, BAR = ThermalStruts(), ThermalFrame(), SpindleGrowth(), BarDrift()
FOR_EVER_S = 1e7


def test_the_law_is_that_of_a_body_heated_evenly():
    time_s = np.linspace(0, 9000, 40)
    solved = solve_ivp(lambda _, share: (1 - share) / 2100.0, (0, 9000), [0.0], t_eval=time_s, rtol=1e-10, atol=1e-12)
    assert np.allclose(warmed(time_s, 2100.0), solved.y[0], atol=1e-8)


def test_nothing_has_happened_before_the_session():
    assert not warmed(np.array([-60.0, -1e-3, 0.0]), 300.0).any()


def test_no_time_constant_is_a_step_at_the_start():
    assert np.array_equal(warmed(np.array([-1.0, 0.0, 1e-9, 50.0]), 0.0), [0, 0, 1, 1])
    assert np.allclose(warmed(np.array([0.0, 50.0]), 1e-6), warmed(np.array([0.0, 50.0]), 0.0))


def test_time_constants_to_search_span_five_minutes_to_four_hours_evenly():
    assert TIME_CONSTANTS_S[0] == 300.0
    assert TIME_CONSTANTS_S[-1] == 14400.0
    assert np.ptp(np.diff(np.log(TIME_CONSTANTS_S))) < 0.02


def test_struts_grow_in_proportion_to_their_length(reference, rng):
    motion = random_run(rng)
    length = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    growth = STRUTS.effect(motion, reference, np.array([25.0, 1800.0])).strut_mm
    expected = 25e-6 * length * (1 - np.exp(-motion.time_s / 1800.0))[:, None]
    assert np.allclose(growth, expected, rtol=1e-12)


def test_grown_struts_lower_the_platform(reference):
    # The platform hangs from the base above it: longer struts let it down.
    motion = replace(jig_runs(30.0)[0], time_s=None)
    motion = replace(motion, time_s=np.full(len(motion), FOR_EVER_S))
    model = MachineModel(reference, (Fitted(STRUTS, np.array([30.0, 600.0])),))
    assert (model.actual_poses(motion)[:, 2] < motion.poses[motion.kept, 2] - 0.02).all()


def test_the_bars_reading_grows_by_the_drift_alone(reference):
    motion = jig_runs(30.0)[4]
    drifting = MachineModel(reference, (Fitted(BAR, np.array([1.7, 900.0]), "bar"),))
    change_um = 1e3 * (drifting.bar(motion).length_mm - MachineModel(reference).bar(motion).length_mm)
    assert np.allclose(change_um, 1.7 * (1 - np.exp(-motion.time_s[motion.kept] / 900.0)), atol=1e-9)
    assert np.array_equal(drifting.actual_poses(motion), MachineModel(reference).actual_poses(motion))


def test_a_grown_plate_is_one_of_another_size(reference, rng):
    """Fully warmed by 20 µm/m: all distances between base joints are longer by that, the middle stays."""
    motion = replace(random_run(rng), time_s=np.full(300, FOR_EVER_S))
    grown = reference.hexapod.base_joints_mm + FRAME.effect(motion, reference, np.array([20.0, 300.0])).base_joint_mm[0]
    here, there = (np.linalg.norm(q[:, None] - q, axis=2) for q in (reference.hexapod.base_joints_mm, grown))
    assert np.allclose(there, here * (1 + 20e-6), rtol=1e-12)
    assert np.allclose(grown.mean(axis=0), reference.hexapod.base_joints_mm.mean(axis=0), atol=1e-12)


def test_machine_and_struts_grown_alike_are_the_same_machine_in_larger(reference, rng):
    """Base, struts and platform all larger by e put the tip e further from the base, tilted as before."""
    motion = replace(random_run(rng, 40), time_s=np.full(40, FOR_EVER_S))
    e = 30e-6
    platform = e * reference.hexapod.platform_joints_mm
    warm = (Fitted(FRAME, np.array([30.0, 300.0])), Fitted(STRUTS, np.array([30.0, 300.0])))
    reached = MachineModel(reference, (*warm, Fitted(PlatformJoints(), platform.ravel()))).actual_poses(motion)
    expected = motion.poses[motion.kept] * [1 + e, 1 + e, 1 + e, 1, 1, 1]
    assert np.allclose(reached, expected, atol=1e-8)


def test_a_grown_spindle_pushes_the_tip_where_the_tool_points(reference):
    """Tilted about X by -20 degrees the tool points to -Y and down: sin and cos of the tilt, in closed form."""
    poses = np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1008.0, -20.0, 0.0, 0.0]])
    motion = Motion(poses, time_s=np.full(2, FOR_EVER_S))
    reached = MachineModel(reference, (Fitted(SPINDLE, np.array([12.0, 600.0])),)).actual_poses(motion)
    shift_um = 1e3 * (reached - poses)[:, :3]
    tilt = np.radians(20.0)
    assert np.allclose(shift_um, [[0, 0, -12], [0, -12 * np.sin(tilt), -12 * np.cos(tilt)]], atol=1e-6)
    assert np.allclose(reached[:, 3:], poses[:, 3:], atol=1e-9)


def test_an_upright_circle_level_with_its_ball_does_not_see_the_spindle_grow(reference):
    motion = run((100, 0, -1008), (0, 0), started_s=1800.0)
    grown = MachineModel(reference, (Fitted(SPINDLE, np.array([10.0, 600.0])),)).bar(motion).length_mm
    assert np.abs(grown - MachineModel(reference).bar(motion).length_mm).max() < 1e-6


@pytest.mark.parametrize(
    ("source", "expected"), [(STRUTS, 0.95), (FRAME, 0.96), (BAR, 0.79)], ids=["struts", "frame", "bar"]
)
def test_a_kinematic_calibration_swallows_most_of_a_steady_drift(reference, source, expected):
    """Shares computed by two independent programs, for the jig circles in their order and a drift even in time."""
    # A time constant of months is a drift even in time.
    values = np.array([1.0, FOR_EVER_S])
    share = concealed_share(reference, jig_runs(step_deg=5.0), lambda m: source.derivative(m, reference, values))
    assert share[0] == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("source", [STRUTS, FRAME, SPINDLE, BAR], ids=["struts", "frame", "spindle", "bar"])
def test_recordings_without_times_are_refused(reference, rng, source):
    with pytest.raises(ModelError, match=f"{source.name} needs time, .* give a recording with times"):
        source.effect(replace(random_run(rng), time_s=None), reference, np.array([1.0, 600.0]))
