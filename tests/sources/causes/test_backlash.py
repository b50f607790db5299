"""Backlash against closed forms of the play operator and what it does to circles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.laws.play import followed, leaning
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.strut_reference_length import StrutReferenceLength
from dbbstation.sources.contract import Fitted
from tests.sources.runs import concealed_share, jig_runs, random_run, run

BACKLASH = Backlash()


def lag_of(travel, width):
    lag, by_width, _ = followed(travel[:, None], np.array([width]), leaning(travel[:, None]))
    return lag[:, 0], by_width[:, 0]


def strut_travel(machine, motion):
    return inverse(machine.hexapod, Frames.from_poses(motion.poses, machine.hexapod.rotation)).length_mm


@pytest.mark.parametrize("width", [0.001, 0.3, 1.9])
def test_lag_on_a_sine_from_the_turning_points(width):
    t = np.linspace(0, 4 * np.pi, 4801)  # the turning points are samples
    travel = np.sin(t)
    # Since its last turning point (+1 or -1) the drive has travelled |x -+ 1|, and the lag has changed by just that.
    shrinking = np.cos(t) < 0
    since = np.where(shrinking, 1 - travel, 1 + travel)
    expected = np.where(shrinking, 1, -1) * (np.minimum(since, width) - width / 2)
    # Before its first turning point the strut grows as if it always had.
    expected[t < np.pi / 2] = -width / 2
    lag, _ = lag_of(travel, width)
    assert np.allclose(lag, expected, atol=1e-12)


def test_a_movement_smaller_than_the_play_moves_nothing():
    t = np.linspace(0, 6 * np.pi, 2000)
    travel = np.concatenate([np.linspace(-5, 0, 100), 0.2 * (np.cos(t) - 1)])
    lag, by_width = lag_of(travel, 1.0)
    assert np.allclose(lag[100:] + travel[100:], -0.5)
    assert np.allclose(by_width, -0.5)


def test_a_strut_at_rest_has_no_lag():
    lag, by_width = lag_of(np.full(50, 812.5), 0.004)
    assert not lag.any()
    assert not by_width.any()


def test_the_place_in_the_play_does_not_hang_on_the_sampling(rng):
    path = np.cumsum(rng.normal(0, 1, 40))
    coarse, _ = lag_of(path, 1.3)
    fine, _ = lag_of(np.interp(np.linspace(0, 39, 39 * 50 + 1), np.arange(40), path), 1.3)
    assert np.allclose(fine[::50], coarse, atol=1e-9)


def test_each_strut_stays_behind_by_half_its_play_and_only_that_strut(reference):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    speed = np.gradient(strut_travel(reference, motion), axis=0)
    for i in range(6):
        play_um = 8.0 * np.eye(6)[i]
        lag_um = 1e3 * BACKLASH.effect(motion, reference, play_um).strut_mm
        assert np.allclose(np.delete(lag_um, i, axis=1), 0, atol=1e-12)
        far = np.abs(speed[:, i]) > 0.1
        assert np.allclose(lag_um[far, i], -4.0 * np.sign(speed[far, i]), atol=1e-9)


def test_the_two_directions_differ_by_the_play(reference):
    there, back = (
        run((-100, 0, -1008), (0, -15), clockwise=clockwise, step_deg=1.0, lead_in_deg=60)
        for clockwise in (False, True)
    )
    nominal = MachineModel(reference)
    actual = MachineModel(reference, (Fitted(BACKLASH, np.full(6, 6.0)),))
    ccw, cw = (actual.bar(m).length_mm - nominal.bar(m).length_mm for m in (there, back))
    # Clockwise the samples stand at minus the angle: turn them round to compare places.
    cw = np.roll(cw[::-1], 1)
    speed = np.gradient(strut_travel(reference, there), axis=0)[there.kept]
    far = (np.abs(speed) > 0.15).all(axis=1)
    # Away from reversals every strut is off by half its play, against its speed, which turns with the direction.
    gain = nominal.bar(there).by_parameters(StrutReferenceLength().derivative(there, reference, np.zeros(6)))
    expected = -0.003 * (gain * np.sign(speed)).sum(axis=1)
    assert far.mean() > 0.5
    assert np.allclose((ccw - cw)[far] / 2, expected[far], atol=2e-6)
    assert np.allclose((ccw + cw)[far] / 2, 0, atol=2e-6)


@pytest.mark.parametrize("width_um", [0.0, 5.0])
def test_no_kinematic_parameter_can_take_it(reference, width_um):
    play_um = np.full(6, width_um)
    share = concealed_share(reference, jig_runs(), lambda m: BACKLASH.derivative(m, reference, play_um))
    assert (share < 0.002).all()


def test_negative_play_is_the_mirror_image(reference, rng):
    motion, play_um = random_run(rng), np.full(6, 5.0)
    ahead = BACKLASH.effect(motion, reference, -play_um).strut_mm
    assert np.array_equal(ahead, -BACKLASH.effect(motion, reference, play_um).strut_mm)


def test_history_before_the_rows_that_count_matters(reference):
    whole = run((0, 0, -1150), (0, 0), lead_in_deg=90)
    bare = replace(whole, poses=whole.poses[whole.kept], time_s=whole.time_s[whole.kept], kept=slice(None))
    play_um = np.full(6, 2000.0)
    with_history = BACKLASH.effect(whole, reference, play_um).strut_mm[whole.kept]
    without = BACKLASH.effect(bare, reference, play_um).strut_mm
    assert not np.allclose(with_history[:20], without[:20])
    assert np.allclose(with_history[-20:], without[-20:])


def test_single_poses_are_refused(reference, rng):
    with pytest.raises(ModelError, match=r"backlash needs path, .* give a program or a recording instead"):
        BACKLASH.effect(replace(random_run(rng), is_path=False), reference, np.ones(6))


WOUND_UP = BACKLASH.other_laws()[0]


def test_a_wound_up_strut_has_the_ends_of_backlash_and_needs_its_length_between_them(reference):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    travel = strut_travel(reference, motion)
    for i in range(6):
        values = np.concatenate([8.0 * np.eye(6)[i], [0.1]])
        error_um = 1e3 * WOUND_UP.effect(motion, reference, values).strut_mm
        backlash_um = 1e3 * BACKLASH.effect(motion, reference, values[:6]).strut_mm
        assert np.allclose(np.delete(error_um, i, axis=1), 0, atol=1e-12)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(travel[:, i]))))
        since = np.full(len(travel), np.inf)
        for turn in turns:
            since[turn + 1 :] = np.abs(travel[turn + 1 :, i] - travel[turn + 1, i])
        far = since > 1.0
        assert np.allclose(error_um[far, i], backlash_um[far, i], atol=1e-3)
        near = (since > 0.02) & (since < 0.05)
        assert np.all(np.abs(error_um[near, i] - backlash_um[near, i]) > 1.0)


def test_no_strut_moves_against_its_drive(reference):
    """A width of 30 µm that winds up over 10 µm would: the wind-up is taken for as long as its width then."""
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.02)
    values = np.array([30.0] * 6 + [0.01])
    travel = strut_travel(reference, motion)
    reached = travel + WOUND_UP.effect(motion, reference, values).strut_mm
    driven, moved = np.diff(travel, axis=0), np.diff(reached, axis=0)
    assert np.all(driven * moved >= 0.0)
    assert np.all(np.abs(moved) <= 2.0 * np.abs(driven) + 1e-12)
