"""Struts that are late, and readings that are: against the differential equation, closed forms and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from dbbstation.errors import ModelError
from dbbstation.laws.memory import lagged
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.base_joints import BaseJoints
from dbbstation.sources.causes.servo_lag import ServoLag
from dbbstation.sources.causes.strut_reference_length import StrutReferenceLength
from dbbstation.sources.causes.time_skew import TimeSkew
from dbbstation.sources.contract import Fitted, Motion
from tests.sources.runs import DEG_PER_S, concealed_share, jig_runs, random_run, run

LAG, SKEW = ServoLag(), TimeSkew()
(BY_DIRECTION,) = LAG.other_laws()
SPEED_MM_S = 1000.0 / 60.0


def travel(machine, motion):
    return inverse(machine.hexapod, Frames.from_poses(motion.poses, machine.hexapod.rotation)).length_mm


def lag_mm(machine, motion, *ms):
    return LAG.effect(motion, machine, np.array(ms, dtype=float)).strut_mm


def shifted_by(motion, late_s, clockwise):
    """The same circle, later: turned about its ball, which stands in its centre, by an exact rotation."""
    angle = np.radians(DEG_PER_S * late_s) * (-1 if clockwise else 1)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    poses = motion.poses.copy()
    poses[:, :3] = motion.setup.fixed_ball_mm + (poses[:, :3] - motion.setup.fixed_ball_mm) @ turn.T
    return replace(motion, poses=poses)


@pytest.mark.parametrize("tau_s", [0.002, 0.3, 2.0])
def test_the_lag_solves_the_loops_equation(tau_s):
    time_s = np.linspace(0, 12, 601)
    speed = np.cos(time_s) + 0.3 * np.sin(2.7 * time_s)
    lag, _ = lagged(speed[:, None], np.diff(time_s), np.array([tau_s]))
    solved = solve_ivp(
        lambda t, e: -e / tau_s - np.cos(t) - 0.3 * np.sin(2.7 * t),
        (0, 12),
        lag[0],
        t_eval=time_s,
        rtol=1e-9,
        atol=1e-11,
        max_step=0.02,
        method="Radau",
    )
    # Speeds are straight between rows: a curved one is off by step² / 8 of its second derivative.
    assert np.allclose(lag[:, 0], solved.y[0], rtol=0, atol=2.0 * tau_s * 0.02**2 / 8 * 3.2)


def test_at_constant_speed_a_strut_is_behind_by_speed_times_time():
    lag, by_constant = lagged(np.full((50, 2), 16.0), np.full(49, 0.01), np.array([0.0, 0.004]))
    assert np.allclose(lag, [0.0, -0.064])
    assert np.allclose(by_constant, -16.0)


def test_uneven_times_make_no_difference(reference, rng):
    even = run((100, 100, -1150), (-10, 10), step_deg=0.25)
    kept = np.sort(np.append(rng.choice(np.arange(1, len(even) - 1), 1500, replace=False), [0, len(even) - 1]))
    uneven = replace(even, poses=even.poses[kept], time_s=even.time_s[kept])
    ms = (3.0, -2.0, 500.0, 0.0, -800.0, 40.0)
    assert np.allclose(lag_mm(reference, uneven, *ms), lag_mm(reference, even, *ms)[kept], rtol=1e-3, atol=1e-5)


def test_what_is_left_open_makes_a_loop_a_pure_delay_in_each_direction(reference):
    """A delay follows x(t - tau), so its error is the loop's without half of tau² d²x/dt²."""
    motion = run((-100, 0, -1008), (0, -15), step_deg=0.25)
    length, time_s = travel(reference, motion), motion.time_s
    delayed = CubicSpline(time_s, length)(time_s - 0.06) - length
    lag, left_open = lag_mm(reference, motion, *[60.0] * 6), LAG.left_open(motion, reference, np.full(6, 60.0)).strut_mm
    inside = slice(20, -20)
    speed = np.gradient(length, time_s, axis=0)
    without = lag - np.sum(left_open, axis=2)
    # The next terms, tau³ d³x/dt³, at 0.11 radians per second and 12 mm/s.
    beyond = 1.5 * 0.06**3 * 0.11**2 * 12
    assert np.abs(lag - delayed)[inside].max() > 5.0 * beyond
    assert np.allclose(without[inside], delayed[inside], rtol=0, atol=beyond)
    longer, shorter = left_open[..., :6], left_open[..., 6:]
    assert not longer[speed < -1.0].any()
    assert not shorter[speed > 1.0].any()


def test_a_strut_ahead_and_one_behind_differ_by_sign_and_curvature(reference):
    motion = run((-100, 0, -1008), (0, -15), step_deg=0.25)
    late, ahead = (lag_mm(reference, motion, *[ms] * 6) for ms in (60.0, -60.0))
    length, h = travel(reference, motion), motion.time_s[1] - motion.time_s[0]
    speed = (length[2:] - length[:-2]) / (2 * h)
    curvature = (length[2:] - 2 * length[1:-1] + length[:-2]) / h**2
    # The next terms, tau³ d³x/dt³ and so on, at 0.11 radians per second and 12 mm/s.
    beyond = 1.5 * (0.06**3) * 0.11**2 * 12
    assert np.allclose(((late - ahead) / 2)[1:-1], -0.06 * speed, rtol=0, atol=beyond)
    assert np.allclose(((late + ahead) / 2)[5:-5], 0.06**2 * curvature[4:-4], rtol=0, atol=0.1 * beyond)


def test_rows_at_one_time_and_single_rows_are_no_movement(reference, rng):
    motion = random_run(rng, 60)
    twice = np.repeat(np.arange(60), 2)
    doubled = replace(motion, poses=motion.poses[twice], time_s=motion.time_s[twice])
    assert np.allclose(lag_mm(reference, doubled, *[5.0] * 6), lag_mm(reference, motion, *[5.0] * 6)[twice])
    standing = Motion(motion.poses[:1], is_path=True, time_s=np.zeros(1))
    assert not lag_mm(reference, standing, *[5.0] * 6).any()
    assert not SKEW.effect(standing, reference, np.array([5.0])).strut_mm.any()


@pytest.mark.parametrize("source", [LAG, SKEW], ids=["lag", "skew"])
def test_unequal_lags_turn_their_sign_with_the_direction(reference, source):
    there, back = (run((100, -100, -1150), (10, 10), clockwise=c, step_deg=1.0) for c in (False, True))
    off = Fitted(StrutReferenceLength(), np.array([0.2, -0.1, 0.3, 0.1, -0.2, 0.0]))  # for a skew to show on
    nominal = MachineModel(reference, (off,))
    values = np.array([2.0, -1.0, 3.0, 1.0, -2.0, 0.5]) if source is LAG else np.array([20.0])
    actual = MachineModel(reference, (off, Fitted(source, values, source.shared_by(there))))
    ccw, cw = (1e3 * (actual.bar(m).length_mm - nominal.bar(m).length_mm) for m in (there, back))
    cw = np.roll(cw[::-1], 1)
    half_sum, half_difference = (ccw + cw) / 2, (ccw - cw) / 2
    assert np.abs(half_sum).max() < 0.01 * np.abs(half_difference).max()
    if source is LAG:
        length, h = travel(reference, there), there.time_s[1] - there.time_s[0]
        speed = np.gradient(length, h, axis=0)[there.kept]
        gain = nominal.bar(there).by_parameters(StrutReferenceLength().derivative(there, reference, np.zeros(6)))
        expected = -(gain * speed * values).sum(axis=1)
        assert np.ptp(expected) > 20
        assert np.allclose(half_difference[:-1], expected[:-1], atol=0.01 * np.ptp(expected))


@pytest.mark.parametrize("tau_s", [0.05, 0.2])
def test_a_common_lag_shrinks_the_circle_and_does_nothing_else_to_it(reference, tau_s):
    """The radius loss of a first-order loop, (v tau)² / 2R; struts are not straight in X and Y, which costs 2 %."""
    late = MachineModel(reference, (Fitted(LAG, np.full(6, 1e3 * tau_s)),))
    loss = (SPEED_MM_S * tau_s) ** 2 / (2 * 150.0)
    for height in (-1150, -1008, -870):
        reading = late.bar(run((0, 0, height), (0, 0), step_deg=0.5)).length_mm
        assert 150.0 - reading.mean() == pytest.approx(loss, rel=0.02)
        assert np.ptp(reading) < 0.35 * loss


def test_a_common_lag_is_a_time_skew(reference, rng):
    off = (Fitted(StrutReferenceLength(), rng.normal(0, 0.2, 6)), Fitted(BaseJoints(), rng.normal(0, 0.2, 18)))
    motion = run((-100, 100, -870), (-10, -10), step_deg=0.5)
    nominal = MachineModel(reference, off).bar(motion).length_mm
    for ms in (2.0, 4.0):
        lag = MachineModel(reference, (*off, Fitted(LAG, np.full(6, ms)))).bar(motion).length_mm
        skew = MachineModel(reference, (*off, Fitted(SKEW, np.array([-ms]), "bar"))).bar(motion).length_mm
        assert np.abs(skew - nominal).max() > 5e-6 * ms
        # Second order in v tau over the radius.
        assert np.abs(lag - skew).max() < 2 * (SPEED_MM_S * 1e-3 * ms) ** 2 / (2 * 150)


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_skew_is_the_reading_of_the_circle_turned_on(reference, rng, clockwise):
    """The poses of a later time by an exact rotation, put through the machine without any source of time."""
    off = MachineModel(
        reference,
        (Fitted(StrutReferenceLength(), rng.normal(0, 0.2, 6)), Fitted(BaseJoints(), rng.normal(0, 0.2, 18))),
    )
    motion = run((100, 100, -1150), (-10, 10), clockwise=clockwise, step_deg=0.5)
    for late_ms in (-200.0, 30.0, 1500.0):
        skewed = replace(off, sources=(*off.sources, Fitted(SKEW, np.array([late_ms]), "bar"))).bar(motion).length_mm
        later = off.bar(shifted_by(motion, 1e-3 * late_ms, clockwise)).length_mm
        inner = slice(0, None if late_ms < 0 else -20)
        assert np.abs(later - off.bar(motion).length_mm).max() > 2e-7 * abs(late_ms)
        assert np.allclose(skewed[inner], later[inner], rtol=0, atol=2e-8)


def test_an_exact_machine_shows_no_skew(reference):
    motion = run((-100, -100, -1150), (10, -10), step_deg=0.5)
    skewed = MachineModel(reference, (Fitted(SKEW, np.array([50.0]), "bar"),)).bar(motion).length_mm
    assert np.allclose(skewed, 150.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("straight", [False, True])
def test_a_lag_by_direction_solves_a_loop_with_a_gain_for_each_way(reference, straight):
    """tau dy/dt = x - y with one tau while y rises, another while it falls, solved by an independent integrator."""
    motion, times = run((100, 100, -1150), (-10, 10), step_deg=0.25), (8.0, 4.0)
    length, time_s = travel(reference, motion)[:, 2], motion.time_s
    command = CubicSpline(time_s, length)

    def speed(t, y):
        behind = command(t) - y
        return behind / (1e-3 * (times[0] if behind > 0.0 else times[1]))

    start = length[:1] - 1e-3 * times[int(command(time_s[0], 1) <= 0.0)] * command(time_s[0], 1)
    solved = solve_ivp(
        speed, time_s[[0, -1]], start, t_eval=time_s, rtol=1e-9, atol=1e-10, max_step=0.02, method="LSODA"
    )
    values = np.zeros(12)
    values[[2, 8]] = np.mean(times), 0.5 * (times[0] - times[1])
    lag = BY_DIRECTION.effect(replace(motion, straight=straight), reference, values).strut_mm[:, 2]
    assert np.ptp(lag) > 0.05
    # Of a loop, a drive at rest before the first row differs for some times tau; between rows the speed is straight.
    late = time_s > time_s[0] + 1.0
    assert np.abs(lag - (solved.y[0] - length))[late].max() < 2e-4


def test_a_lag_alike_in_both_directions_is_the_simple_law(reference):
    motion, ms = run((-100, 50, -1008), (10, -5), step_deg=0.5), np.array([3.0, -2.0, 5.0, 0.0, -1.0, 4.0])
    for straight in (False, True):
        at = replace(motion, straight=straight)
        simple, other = (
            law.effect(at, reference, v).strut_mm for law, v in ((LAG, ms), (BY_DIRECTION, np.append(ms, np.zeros(6))))
        )
        assert np.array_equal(simple, other)


def test_no_kinematic_parameter_can_take_a_lag(reference):
    share = concealed_share(reference, jig_runs(4.0), lambda m: LAG.derivative(m, reference, np.zeros(6)))
    assert (share < 0.002).all()


@pytest.mark.parametrize("apart_ms", [(), (2.0, 1.0, -3.0, -1.0, 4.0, 0.0)], ids=["simple", "by direction"])
def test_lags_are_compensated(reference, apart_ms):
    values = np.array([8.0, -3.0, 5.0, 2.0, 12.0, 6.0, *apart_ms])
    model = MachineModel(reference, (Fitted(BY_DIRECTION if apart_ms else LAG, values),))
    wanted = replace(run((100, 100, -1150), (-10, 10), step_deg=0.5), kept=slice(None))
    commanded = compensated(model, wanted)
    assert np.abs(commanded - wanted.poses)[:, :3].max() > 0.05
    assert np.allclose(
        model.actual_poses(replace(wanted, poses=commanded, straight=True)), wanted.poses, rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("source", [LAG, SKEW], ids=["lag", "skew"])
@pytest.mark.parametrize("without", [{"is_path": False}, {"time_s": None}], ids=["path", "time"])
def test_motions_without_path_or_time_are_refused(reference, rng, source, without):
    with pytest.raises(ModelError, match=f"{source.name} needs"):
        source.effect(replace(random_run(rng), **without), reference, np.ones(6))
