"""Spikes at reversal: where struts turn by root finding, how they fade by a loop in time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.reversal_spike import DECAY_MM, ReversalSpike
from dbbstation.sources.contract import Effect, Fitted
from dbbstation.sources.laws.motion import since_turning
from tests.sources.runs import DEG_PER_S, circle, concealed_share, jig_runs, random_run, run

SPIKE = ReversalSpike()
(IN_TIME,) = SPIKE.other_laws()
PLACE, TILT = (100, 100, -1150), (-10, 10)


def spike_um(machine, motion, heights_um, decay_mm=0.2):
    values = np.array([*np.broadcast_to(heights_um, 6), decay_mm])
    return 1e3 * SPIKE.effect(motion, machine, values).strut_mm


def heights_only(motion, machine, values):
    return Effect(strut_mm=SPIKE.derivative(motion, machine, values).strut_mm[:, :, :6])


def turning_points_deg(machine, place, tilt, strut):
    """Angles at which a strut's length is stationary along the circle, from the formula of the length alone."""
    frames = Frames.from_poses(np.array([[*place, *tilt, 0.0]]), machine.hexapod.rotation)
    arm = inverse(machine.hexapod, frames).arm_mm[0, strut]
    base = machine.hexapod.base_joints_mm[strut]

    def slope(theta):  # of half the squared length
        radial, along = np.array([np.cos(theta), np.sin(theta), 0]), np.array([-np.sin(theta), np.cos(theta), 0])
        return (np.array(place) + 150 * radial + arm - base) @ along

    edges = np.radians(np.arange(0, 360.5, 3.0) + 0.1234)
    return [np.degrees(brentq(slope, a, b)) for a, b in pairwise(edges) if slope(a) * slope(b) < 0]


@pytest.mark.parametrize("clockwise", [False, True])
def test_spikes_sit_where_struts_turn_and_not_where_axes_do(reference, clockwise):
    motion = run(PLACE, TILT, clockwise=clockwise, step_deg=0.5, lead_in_deg=120)
    theta = np.degrees(np.arctan2(*(motion.poses[:, 1::-1] - np.array(PLACE)[1::-1]).T)) % 360
    spikes = spike_um(reference, motion, 3.0)[motion.kept]
    theta = theta[motion.kept]
    for i in range(6):
        points = turning_points_deg(reference, PLACE, TILT, i)
        assert len(points) == 2
        tall = theta[np.abs(spikes[:, i]) > 1.5]
        away = np.abs((tall[:, None] - np.array(points) + 180) % 360 - 180)
        # They lie behind the turning point in the direction of travel.
        assert len(tall) > 4
        assert away.min(axis=1).max() < 5
        assert (away.min(axis=0) < 1.5).all()
        past = ((tall[:, None] - np.array(points)) * (-1 if clockwise else 1) + 180) % 360 - 180
        assert (np.abs(past).min(axis=1) == np.where(past > 0, past, 360).min(axis=1)).all()
    axes = np.arange(0, 360, 90)
    every = np.concatenate([turning_points_deg(reference, PLACE, TILT, i) for i in range(6)])
    assert (np.abs((every[:, None] - axes + 180) % 360 - 180).min(axis=1) > 5).mean() > 0.5


def test_it_follows_a_loop_over_the_way(reference):
    """Brute force at fifty times the samples: the way is added up step by step, and begins anew where a strut turns."""
    coarse, fine = (run(PLACE, TILT, step_deg=step) for step in (0.5, 0.01))
    length = inverse(reference.hexapod, Frames.from_poses(fine.poses, reference.hexapod.rotation)).length_mm
    heights, decay = np.array([3.0, -2.0, 1.0, 4.0, 0.0, 2.0]), 0.03
    way, turned, last = np.zeros(6), np.zeros(6, bool), np.sign(length[1] - length[0])
    loop = np.zeros_like(length)
    for k in range(1, len(length)):
        step = length[k] - length[k - 1]
        turned |= np.sign(step) != last
        way = np.where(np.sign(step) != last, 0.0, way) + np.abs(step)
        last = np.sign(step)
        rise = 1 - np.exp(-way / np.maximum(1.1e-3 * np.abs(heights), 1e-9))
        loop[k] = np.where(turned, -last * heights * rise * np.exp(-np.sqrt(way / decay)), 0.0)
    # The fine rows miss the turning point by up to half a step, 30 mm (0.005 deg)^2 = 0.0002 mm; a spike grows by as much there.
    assert np.abs(loop).max() > 1.5
    assert np.allclose(spike_um(reference, coarse, heights, decay), loop[::50], rtol=0, atol=0.2)


def test_it_fades_exponentially_in_time_behind_a_turning_point(reference):
    """A loop that makes up for friction with 0.13 s, at the acceleration that lengths at three times show."""
    motion, fading_s, strut = run(PLACE, TILT, step_deg=0.05), 0.13, 5
    length = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm[:, strut]
    for turning_deg in turning_points_deg(reference, PLACE, TILT, strut):
        since_s = motion.time_s - turning_deg / DEG_PER_S
        top = int(np.argmin(np.abs(since_s)))
        acceleration = (length[top - 1] - 2 * length[top] + length[top + 1]) / (
            motion.time_s[1] - motion.time_s[0]
        ) ** 2
        behind = (since_s > 0) & (since_s < 0.4)
        expected = -np.sign(acceleration) * 1e-6 * np.exp(-since_s[behind] / fading_s)
        # A height of nothing, so that it has no rise.
        found = spike_um(reference, motion, 1e-6, abs(acceleration) * fading_s**2 / 2)[behind, strut]
        assert behind.sum() > 40
        assert np.allclose(found, expected, rtol=3e-3, atol=0)


def test_in_time_it_fades_alike_behind_every_turning_point(reference):
    """exp(-t / T), t since the angles at which the formula of a strut's length is stationary."""
    motion, fading_s = run(PLACE, TILT, step_deg=0.25), 0.3
    spikes = IN_TIME.effect(motion, reference, np.array([*[1e-6] * 6, fading_s])).strut_mm  # too low to have a rise
    for strut in range(6):
        for turning_deg in turning_points_deg(reference, PLACE, TILT, strut):
            since_s = motion.time_s - turning_deg / DEG_PER_S
            behind = (since_s > 0.01) & (since_s < 1.0)
            assert behind.sum() > 20
            found = np.abs(spikes[behind, strut])
            assert np.allclose(found, 1e-9 * np.exp(-since_s[behind] / fading_s), rtol=3e-3, atol=0)


@pytest.mark.parametrize("straight", [False, True])
def test_in_time_a_feed_that_is_half_as_high_changes_how_far_it_reaches(reference, straight):
    motion = replace(run(PLACE, TILT, step_deg=0.5), straight=straight)
    values = np.array([*[3.0] * 6, 0.3])
    slow = replace(motion, time_s=2.0 * motion.time_s)
    half = np.array([*[3.0] * 6, 0.15])
    assert np.allclose(
        IN_TIME.effect(slow, reference, values).strut_mm, IN_TIME.effect(motion, reference, half).strut_mm, atol=1e-12
    )


def test_in_time_straight_rows_and_a_smooth_path_agree(reference):
    smooth, values = run(PLACE, TILT, step_deg=0.02), np.array([3.0, -2.0, 1.0, 4.0, 0.5, 2.0, 0.2])
    straight = replace(smooth, straight=True)
    found = [IN_TIME.effect(motion, reference, values).strut_mm for motion in (smooth, straight)]
    assert np.abs(found[0]).max() > 1.5e-3
    assert np.allclose(*found, atol=2e-5)


@pytest.mark.parametrize("source", [SPIKE, IN_TIME], ids=["way", "time"])
def test_derivatives_are_those_of_finite_differences(reference, source):
    motion, values, h = run(PLACE, TILT), np.array([3.0, -2.0, 1.0, 4.0, 0.5, 2.0, 0.02]), 1e-6
    exact = source.derivative(motion, reference, values).strut_mm
    assert np.abs(exact[:, :, 6]).max() > 1e-3
    for p, unit in enumerate(h * np.eye(7)):
        up, down = (source.effect(motion, reference, values + side * unit).strut_mm for side in (1, -1))
        assert np.allclose(exact[:, :, p], (up - down) / (2 * h), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("height_um", [4.0, -4.0])
@pytest.mark.parametrize("decay_mm", [DECAY_MM[0], 0.01, DECAY_MM[-1]])
def test_travel_and_error_together_always_grow(reference, height_um, decay_mm):
    motion = run(PLACE, TILT, step_deg=0.005)
    length = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    since, spikes = since_turning(length), 1e-3 * spike_um(reference, motion, height_um, decay_mm)
    same = (np.sign(since[1:]) == np.sign(since[:-1])) & (since[1:] != 0)
    ratio = np.diff(spikes, axis=0)[same] / np.diff(length, axis=0)[same]
    assert ratio.min() > -1.0
    assert np.abs(ratio).max() == pytest.approx(1 / 1.1, rel=0.05)  # a strut that sticks hardly moves


def test_way_since_the_turning_point(rng):
    zigzag = np.array([0.0, 1.0, 2.0, 1.5, 0.5, 0.7, 1.0, 0.2])
    expected = [0.0, 0.0, 0.0, -0.5, 0.0, 0.2, 0.0, -0.8]
    assert np.allclose(since_turning(zigzag[:, None])[:, 0], expected)
    between = zigzag[np.repeat(np.arange(8), 30)] + rng.uniform(-4e-4, 4e-4, 240)  # rounded there and back
    assert np.allclose(since_turning(between[:, None])[30::60, 0], expected[1::2], atol=1e-3)
    assert not since_turning(np.full((5, 2), 700.0)).any()


def turning_columns(angle_rad):
    """Two columns that turn round as a circle has it, and the way of the first since, in closed form."""
    travel = 40.0 * np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    half_turns = np.floor(angle_rad / np.pi)
    since = travel[:, 0] - 40.0 * np.cos(np.pi * half_turns)
    return travel, np.where(half_turns > 0, since, 0.0)


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_the_turning_point_lies_between_rows(rng, mirrored):
    """Circles in steps of 0.02 rad, a fall of 8 um beside the turning point: exact to the cube of the step."""
    for _ in range(100):
        travel, expected = turning_columns(np.arange(0, 8, 0.02) + rng.uniform(0, 0.02))
        assert np.allclose(mirrored * since_turning(mirrored * travel)[:, 0], expected, rtol=0, atol=4e-5)
        # A row before the turning point belongs to the movement before, one behind it to the next.
        assert (np.sign(since_turning(travel)[:, 0]) == np.sign(expected)).all()


def test_rows_that_are_not_even_and_angles_that_were_rounded_change_nothing(rng):
    for _ in range(100):
        angle = np.cumsum(rng.choice([0.01, 0.02, 0.03], 400))
        travel, expected = turning_columns(angle)
        assert np.allclose(since_turning(travel)[:, 0], expected, rtol=0, atol=2e-4)
        rounded = np.round(np.arange(0, 8, 0.002) + rng.uniform(0, 0.002), 3)
        travel, expected = turning_columns(rounded)
        assert np.allclose(since_turning(travel)[:, 0], expected, rtol=0, atol=1e-6)


def test_where_rows_repeat_at_the_turn_or_the_path_comes_straight_back_the_outermost_row_is_the_turn():
    travel, _ = turning_columns(np.arange(0.0137, 8, 0.02))
    top = int(np.argmin(travel[:250, 0]))
    stands = np.insert(travel, top, travel[top], axis=0)
    assert since_turning(stands)[top + 2, 0] == pytest.approx(travel[top + 1, 0] - travel[top, 0], rel=1e-12)
    back = np.concatenate([travel[:200:-1], travel[203:300]])  # a turn of its own at a corner: no parabola
    corner = len(travel) - 202
    assert not since_turning(back)[corner].any()


def test_the_way_does_not_jump_where_two_rows_are_equally_far_out():
    travel, _ = turning_columns(np.arange(-160, 161) * 0.02 + np.pi + 0.01)
    travel[161:, 0] = -40.0 + (travel[161:, 0] + 40.0) / 1.5  # as one that undoes a spike of negative height
    first, second = 159, 160
    travel[second, 0] = travel[first, 0]
    ways = []
    for shift in (-1e-9, 1e-9):
        travel[second, 0] += shift
        ways.append(since_turning(travel)[163:, 0])
        travel[second, 0] -= shift
    assert np.abs(ways[0]).min() > 0
    assert np.allclose(ways[0], ways[1], rtol=0, atol=1e-8)


def test_both_ends_of_the_travel_have_opposite_spikes_and_each_strut_its_own(reference):
    motion = run(PLACE, TILT, step_deg=0.25)
    # Greatest value of (1 - exp(-d / 1.1 a)) exp(-sqrt(d / l)), of many.
    way = np.geomspace(1e-4, 1, 10000)
    greatest = 3.0 * ((1 - np.exp(-way / 0.0033)) * np.exp(-np.sqrt(way / 0.2))).max()
    for i in range(6):
        spikes = spike_um(reference, motion, 3.0 * np.eye(6)[i])
        assert not np.delete(spikes, i, axis=1).any()
        assert spikes[:, i].max() == pytest.approx(greatest, rel=0.02)
        assert spikes[:, i].min() == pytest.approx(-greatest, rel=0.02)


def test_both_directions_have_it_on_either_side_with_one_sign(reference):
    there, back = (run(PLACE, TILT, clockwise=c, step_deg=0.5, lead_in_deg=180) for c in (False, True))
    ccw, cw = (spike_um(reference, m, 3.0)[m.kept] for m in (there, back))
    cw = np.roll(cw[::-1], 1, axis=0)
    length = inverse(reference.hexapod, Frames.from_poses(there.poses, reference.hexapod.rotation)).length_mm[
        there.kept
    ]
    for i in range(6):
        longest = int(np.argmax(length[:, i]))
        near = np.arange(longest - 20, longest + 21) % len(length)
        for spikes in (ccw, cw):
            assert spikes[near, i].max() > 2
            assert spikes[near, i].min() > -0.2
        assert abs(int(np.argmax(ccw[near, i])) + int(np.argmax(cw[near, i])) - 40) <= 2
        assert np.argmax(ccw[near, i]) > 20


def test_joints_and_lengths_cannot_take_what_is_so_narrow(reference):
    values = np.array([*[0.0] * 6, 0.2])
    share = concealed_share(reference, jig_runs(), lambda m: heights_only(m, reference, values))
    assert (share < 0.1).all()


def test_without_a_turning_point_there_is_no_spike_and_the_way_there_counts(reference):
    whole = run(PLACE, TILT, step_deg=0.5, lead_in_deg=180)
    bare = replace(whole, poses=whole.poses[whole.kept], time_s=whole.time_s[whole.kept], kept=slice(None))
    after, without = spike_um(reference, whole, 3.0, 1.0)[whole.kept], spike_um(reference, bare, 3.0, 1.0)
    assert not without[0].any()
    assert not np.allclose(after[:40], without[:40])
    assert np.allclose(after[-40:], without[-40:])


def test_a_decay_of_nothing_is_nothing(reference, rng):
    assert not spike_um(reference, random_run(rng), 3.0, 0.0).any()


@pytest.mark.parametrize("source", [SPIKE, IN_TIME], ids=["way", "time"])
def test_it_is_compensated(reference, source):
    values = np.array([2.0, -1.0, 3.0, 2.0, 1.0, 2.5, 0.1])
    model = MachineModel(reference, (Fitted(source, values),))
    wanted = replace(run(PLACE, TILT, step_deg=0.5), kept=slice(None))
    commanded = compensated(model, wanted)
    assert np.abs(commanded - wanted.poses)[:, :3].max() > 1e-3
    assert np.allclose(
        model.actual_poses(replace(wanted, poses=commanded, straight=True)), wanted.poses, rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("height_um", [8.0, -8.0])
def test_it_is_compensated_wherever_rows_lie_about_the_turning_points(reference, rng, height_um):
    model = MachineModel(reference, (Fitted(SPIKE, np.array([*[height_um] * 6, 0.01])),))
    for offset_deg in rng.uniform(0, 1, 20):
        wanted = circle(PLACE, TILT, np.arange(0, 360) + offset_deg, is_path=True)
        commanded = compensated(model, wanted)
        assert np.allclose(
            model.actual_poses(replace(wanted, poses=commanded, straight=True)), wanted.poses, rtol=0, atol=1e-8
        )


def test_single_poses_are_refused(reference, rng):
    with pytest.raises(ModelError, match="reversal-spike needs path"):
        spike_um(reference, replace(random_run(rng), is_path=False), 3.0)
