"""Struts, frame, spindle and bar that warm up, against the law's own definition and what circles can see of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.bar_drift import BarDrift
from dbbstation.sources.causes.platform_joints import PlatformJoints
from dbbstation.sources.causes.spindle_growth import SpindleGrowth
from dbbstation.sources.causes.thermal_frame import ThermalFrame
from dbbstation.sources.causes.thermal_struts import ThermalStruts
from dbbstation.sources.contract import Fitted, Motion, Setup
from dbbstation.sources.laws.temperature import PAUSE_S, TIME_CONSTANTS_S, pauses_s, warmed
from tests.plant.mechanisms.warming import Warming
from tests.sources.runs import concealed_share, jig_runs, random_run, run

STRUTS, FRAME, SPINDLE, BAR = ThermalStruts(), ThermalFrame(), SpindleGrowth(), BarDrift()
IN_STAGES = next(law for law in BAR.other_laws() if law.law == "two-stages")
FOR_EVER_S = 1e7
TIMES_S = np.linspace(0.0, 14000.0, 281)
RUNS_S = ((0.0, 1500.0), (1700.0, 2600.0), (5000.0, 6000.0), (6900.0, 14000.0))
"""A session with two pauses, of 40 and of 15 minutes, and one gap that is none."""


def in_session(time_s, moving_s=RUNS_S) -> Motion:
    setup = Setup("session", "mounting", "ball", "bar", np.zeros(3), 1e-3, 1e-3, 5e-4, moving_s=moving_s)
    return Motion(np.zeros((len(time_s), 6)), time_s=time_s, setup=setup)


def test_the_law_is_that_of_a_body_heated_evenly():
    time_s = np.linspace(0, 9000, 40)
    solved = solve_ivp(lambda _, share: (1 - share) / 2100.0, (0, 9000), [0.0], t_eval=time_s, rtol=1e-10, atol=1e-12)
    assert np.allclose(warmed(time_s, 2100.0), solved.y[0], atol=1e-8)


def test_pauses_are_gaps_of_ten_minutes_and_more_between_runs():
    assert pauses_s(in_session(TIMES_S)) == [(2600.0, 5000.0), (6000.0, 6900.0)]
    assert pauses_s(in_session(TIMES_S, ((0.0, 100.0), (100.0 + PAUSE_S - 1.0, 3000.0)))) == []
    # A run that was begun within another one, as a clock that was set says, ends no pause.
    assert pauses_s(in_session(TIMES_S, ((0.0, 900.0), (50.0, 60.0), (1000.0, 1100.0)))) == []
    assert pauses_s(in_session(TIMES_S, ())) == []
    assert pauses_s(Motion(np.zeros((1, 6)), time_s=np.zeros(1))) == []


@pytest.mark.parametrize(("start", "working", "paused"), [(0.0, 9.0, 0.0), (4.0, 9.0, 2.5), (7.0, 0.0, 0.0)])
def test_the_law_is_that_of_a_body_whose_heat_pauses(start, working, paused):
    """Newton's law of cooling, solved piece by piece: from a start towards one excess at work, another in pauses."""
    edges = [0.0, 2600.0, 5000.0, 6000.0, 6900.0, 14000.0]
    excess, expected = start, np.zeros(len(TIMES_S))
    for k, (begin, end) in enumerate(pairwise(edges)):
        towards = paused if k % 2 else working
        inside = (begin <= TIMES_S) & (TIMES_S <= end)  # noqa: SIM300 - a time between two
        solved = solve_ivp(
            lambda _, y, to=towards: (to - y) / 2100.0,
            (begin, end),
            [excess],
            dense_output=True,
            rtol=1e-10,
            atol=1e-12,
        )
        expected[inside], excess = solved.sol(TIMES_S[inside])[0] - start, solved.y[0][-1]
    values = np.array([working - start, 2100.0, working - paused])
    assert np.allclose(BAR.grown(in_session(TIMES_S), values), expected, atol=1e-7)


def test_it_is_the_law_of_the_reference_plant():
    """A machine 500 s warm already, whose drives are off in both pauses."""
    scene = SimpleNamespace(slots=(), end_s=14000.0)
    off_s = tuple(pauses_s(in_session(TIMES_S)))
    times_s, excess_k = Warming(5.0, 1500.0, idle_share=1.0, head_start_s=500.0, off_s=off_s).history(scene, 14000.0)
    expected = np.interp(TIMES_S, times_s, excess_k)
    values = np.array([5.0 * np.exp(-500.0 / 1500.0), 1500.0, 5.0])
    assert np.allclose(BAR.grown(in_session(TIMES_S), values), expected - expected[0], atol=5e-3)


def test_what_heats_only_while_runs_are_on_is_hardly_told_from_its_mean():
    """Sixty runs of 100 s with 100 s between them, no heat there: a ripple of 0.17 in 4 K is left."""
    slots = tuple(SimpleNamespace(start_s=200.0 * k, end_s=200.0 * k + 100.0) for k in range(60))
    scene = SimpleNamespace(slots=slots, end_s=12000.0)
    times_s, excess_k = Warming(8.0, 2400.0, idle_share=0.0).history(scene, 12000.0)
    time_s = np.linspace(0.0, 11900.0, 300)
    motion = in_session(time_s, tuple((slot.start_s, slot.end_s) for slot in slots))
    # At most the heat by which one run is off the mean, over the time constant.
    ripple_k = 4.0 * 100.0 / 2400.0
    expected = np.interp(time_s, times_s, excess_k)
    assert np.abs(BAR.grown(motion, np.array([4.0, 2400.0, 4.0])) - expected).max() < ripple_k


def test_derivatives_of_the_law_are_its_differences():
    motion, values = in_session(TIMES_S), np.array([12.0, 1700.0, -7.0])
    steps = np.diag([1e-3, 0.1, 1e-3])
    differences = [
        (BAR.grown(motion, values + step) - BAR.grown(motion, values - step)) / (2 * step.max()) for step in steps
    ]
    assert np.allclose(BAR.grown_by(motion, values), np.column_stack(differences), rtol=1e-6, atol=1e-9)


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
    growth = STRUTS.effect(motion, reference, np.array([25.0, 1800.0, 0.0])).strut_mm
    expected = 25e-6 * length * (1 - np.exp(-motion.time_s / 1800.0))[:, None]
    assert np.allclose(growth, expected, rtol=1e-12)


def test_grown_struts_lower_the_platform(reference):
    # The platform hangs from the base above it: longer struts let it down.
    motion = replace(jig_runs(30.0)[0], time_s=None)
    motion = replace(motion, time_s=np.full(len(motion), FOR_EVER_S))
    model = MachineModel(reference, (Fitted(STRUTS, np.array([30.0, 600.0, 0.0])),))
    assert (model.actual_poses(motion)[:, 2] < motion.poses[motion.kept, 2] - 0.02).all()


def test_the_bars_reading_grows_by_the_drift_alone(reference):
    motion = jig_runs(30.0)[4]
    drifting = MachineModel(reference, (Fitted(BAR, np.array([1.7, 900.0, 0.0]), "bar"),))
    change_um = 1e3 * (drifting.bar(motion).length_mm - MachineModel(reference).bar(motion).length_mm)
    assert np.allclose(change_um, 1.7 * (1 - np.exp(-motion.time_s[motion.kept] / 900.0)), atol=1e-9)
    assert np.array_equal(drifting.actual_poses(motion), MachineModel(reference).actual_poses(motion))


def test_a_grown_plate_is_one_of_another_size(reference, rng):
    """Fully warmed by 20 µm/m: all distances between base joints are longer by that, the middle stays."""
    motion = replace(random_run(rng), time_s=np.full(300, FOR_EVER_S))
    grown = (
        reference.hexapod.base_joints_mm
        + FRAME.effect(motion, reference, np.array([20.0, 300.0, 0.0])).base_joint_mm[0]
    )
    here, there = (np.linalg.norm(q[:, None] - q, axis=2) for q in (reference.hexapod.base_joints_mm, grown))
    assert np.allclose(there, here * (1 + 20e-6), rtol=1e-12)
    assert np.allclose(grown.mean(axis=0), reference.hexapod.base_joints_mm.mean(axis=0), atol=1e-12)


def test_machine_and_struts_grown_alike_are_the_same_machine_in_larger(reference, rng):
    motion = replace(random_run(rng, 40), time_s=np.full(40, FOR_EVER_S))
    e = 30e-6
    platform = e * reference.hexapod.platform_joints_mm
    warm = (Fitted(FRAME, np.array([30.0, 300.0, 0.0])), Fitted(STRUTS, np.array([30.0, 300.0, 0.0])))
    reached = MachineModel(reference, (*warm, Fitted(PlatformJoints(), platform.ravel()))).actual_poses(motion)
    expected = motion.poses[motion.kept] * [1 + e, 1 + e, 1 + e, 1, 1, 1]
    assert np.allclose(reached, expected, atol=1e-8)


def test_a_grown_spindle_pushes_the_tip_where_the_tool_points(reference):
    """Tilted about X by -20 degrees the tool points to -Y and down: sin and cos of the tilt, in closed form."""
    poses = np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1008.0, -20.0, 0.0, 0.0]])
    motion = Motion(poses, time_s=np.full(2, FOR_EVER_S))
    reached = MachineModel(reference, (Fitted(SPINDLE, np.array([12.0, 600.0, 0.0, 0.0])),)).actual_poses(motion)
    shift_um = 1e3 * (reached - poses)[:, :3]
    tilt = np.radians(20.0)
    assert np.allclose(shift_um, [[0, 0, -12], [0, -12 * np.sin(tilt), -12 * np.cos(tilt)]], atol=1e-6)
    assert np.allclose(reached[:, 3:], poses[:, 3:], atol=1e-9)


@pytest.mark.parametrize(("growth_um", "percent", "z_um"), [(-18.0, -100.0, (-18.0, 0.0)), (18.0, 25.0, (-4.5, -22.5))])
def test_a_spindle_that_was_warm_before_cools_to_nominal_and_one_that_had_begun_grows_on(
    reference, growth_um, percent, z_um
):
    """Where the tip stands at the first sample and in the end, counted by hand."""
    poses = np.tile([0.0, 0.0, -1008.0, 0.0, 0.0, 0.0], (2, 1))
    motion = Motion(poses, time_s=np.array([0.0, FOR_EVER_S]))
    fitted = Fitted(SPINDLE, np.array([growth_um, 600.0, 0.0, percent]))
    reached = MachineModel(reference, (fitted,)).actual_poses(motion)
    assert 1e3 * (reached - poses)[:, 2] == pytest.approx(z_um, abs=1e-6)


def test_an_upright_circle_level_with_its_ball_does_not_see_the_spindle_grow(reference):
    motion = run((100, 0, -1008), (0, 0), started_s=1800.0)
    grown = MachineModel(reference, (Fitted(SPINDLE, np.array([10.0, 600.0, 0.0, 30.0])),)).bar(motion).length_mm
    assert np.abs(grown - MachineModel(reference).bar(motion).length_mm).max() < 1e-6


@pytest.mark.parametrize(
    ("source", "expected"), [(STRUTS, 0.95), (FRAME, 0.96), (BAR, 0.79)], ids=["struts", "frame", "bar"]
)
def test_a_kinematic_calibration_swallows_most_of_a_steady_drift(reference, source, expected):
    """Shares computed by two independent programs, for the jig circles in their order and a drift even in time."""
    # A time constant of months is a drift even in time.
    values = np.array([1.0, FOR_EVER_S, 0.0])
    by_growth = np.eye(3)[:, :1]
    runs = jig_runs(step_deg=5.0)
    share = concealed_share(reference, runs, lambda m: source.derivative(m, reference, values).times(by_growth))
    assert share[0] == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("source", [STRUTS, FRAME, SPINDLE, BAR], ids=["struts", "frame", "spindle", "bar"])
def test_recordings_without_times_are_refused(reference, rng, source):
    with pytest.raises(ModelError, match=f"{source.name} needs time, .* give a recording with times"):
        source.effect(replace(random_run(rng), time_s=None), reference, np.array([1.0, 600.0, 0.0]))


def test_two_stages_are_two_bodies_heated_one_through_the_other():
    """Newton's law for both, solved piece by piece: from rest, heat at work and another in pauses."""
    edges, state, expected = [0.0, 2600.0, 5000.0, 6000.0, 6900.0, 14000.0], np.zeros(2), np.zeros(len(TIMES_S))
    for k, (begin, end) in enumerate(pairwise(edges)):
        heat, inside = (2.5, 9.0)[k % 2 == 0], (begin <= TIMES_S) & (TIMES_S <= end)  # noqa: SIM300 - a time between two
        solved = solve_ivp(
            lambda _, y, heat=heat: [(heat - y[0]) / 1050.0, (y[0] - y[1]) / 2100.0],
            (begin, end),
            state,
            dense_output=True,
            rtol=1e-10,
            atol=1e-12,
        )
        expected[inside], state = solved.sol(TIMES_S[inside])[1], solved.y[:, -1]
    values = np.array([9.0, 2100.0, 9.0 - 2.5, 4.5])
    reading = IN_STAGES.effect(in_session(TIMES_S), None, values).reading_mm
    assert np.allclose(1e3 * reading, expected, atol=1e-7)


def test_without_delayed_growth_two_stages_are_one_body():
    motion, values = in_session(TIMES_S), np.array([12.0, 1700.0, 0.0])
    one, both = BAR.effect(motion, None, values), IN_STAGES.effect(motion, None, np.append(values, 0.0))
    assert np.allclose(both.reading_mm, one.reading_mm, atol=1e-15)
    assert IN_STAGES.simpler_law == BAR.law


@pytest.mark.parametrize("ratio", [0.3, 0.4, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("constant_s", [900.0, 2000.0, 4000.0])
def test_two_stages_follow_bodies_of_other_ratios(ratio, constant_s):
    """The step response of two bodies in closed form; one body is 6 to 11 % off it."""
    time_s = np.linspace(0.0, 9000.0, 200)
    motion = in_session(time_s, ())
    step = (np.expm1(-time_s / constant_s) - ratio * np.expm1(-time_s / (ratio * constant_s))) / (ratio - 1.0)

    def off(law):
        found = []
        for tau_s in np.geomspace(300.0, 14400.0, 200):
            columns = law(tau_s)
            left = step - columns @ np.linalg.lstsq(columns, step, rcond=None)[0]
            found.append(np.sqrt(np.mean(left**2)) / np.std(step))
        return min(found)

    def in_stages(tau_s):
        by = IN_STAGES.derivative(motion, None, np.array([1.0, tau_s, 0.0, 0.0])).reading_mm
        return np.column_stack([1e3 * by[:, [0, 3]], np.ones(len(time_s))])

    def as_one(tau_s):
        return np.column_stack([warmed(time_s, tau_s), np.ones(len(time_s))])

    assert off(in_stages) < 0.013
    assert off(as_one) > 0.06
