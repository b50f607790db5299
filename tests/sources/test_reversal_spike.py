"""Spikes at reversal: where struts turn by root finding, how they fade by a loop in time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from dbbstation.errors import ModelError
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.rotation import Frames
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Effect, Fitted
from dbbstation.sources.reversal_spike import ReversalSpike, since_turning
from tests.sources.runs import concealed_share, jig_runs, random_run, run

SPIKE = ReversalSpike()
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
        tall = theta[np.abs(spikes[:, i]) > 2.0]
        away = np.abs((tall[:, None] - np.array(points) + 180) % 360 - 180)
        # They lie behind the turning point in the direction of travel.
        assert len(tall) > 4
        assert away.min(axis=1).max() < 5
        assert (away.min(axis=0) < 1.5).all()
        past = ((tall[:, None] - np.array(points)) * (-1 if clockwise else 1) + 180) % 360 - 180
        assert (np.abs(past).min(axis=1) == np.where(past > -0.5, past, 360).min(axis=1)).all()
    axes = np.arange(0, 360, 90)
    every = np.concatenate([turning_points_deg(reference, PLACE, TILT, i) for i in range(6)])
    assert (np.abs((every[:, None] - axes + 180) % 360 - 180).min(axis=1) > 5).mean() > 0.5


def test_it_fades_as_a_loop_in_time_has_it(reference):
    """Brute force at fifty times the samples: what lacks in the rise and what is left of the spike fade with |dx|."""
    coarse, fine = (run(PLACE, TILT, step_deg=step) for step in (0.5, 0.01))
    length = inverse(reference.hexapod, Frames.from_poses(fine.poses, reference.hexapod.rotation)).length_mm
    heights, decay = np.array([3.0, -2.0, 1.0, 4.0, 0.0, 2.0]), 0.3
    lacking, left, last = np.ones(6), np.zeros(6), np.sign(length[1] - length[0])
    loop = np.zeros_like(length)
    for k in range(1, len(length)):
        step = np.abs(length[k] - length[k - 1])
        way = np.sign(length[k] - length[k - 1])
        lacking, left = np.where(way != last, 1.0, lacking), np.where(way != last, 1.0, left)
        lacking = lacking * np.exp(-step / np.maximum(2e-3 * np.abs(heights), 1e-9))
        left, last = left * np.exp(-step / decay), way
        loop[k] = -way * heights * (1 - lacking) * left
    expected, found = loop[::50], spike_um(reference, coarse, heights, decay)
    # A turning point lies up to half a sample beside the outermost sample; there the two may differ.
    near = np.abs(since_turning(length)[::50]) < 0.003
    assert np.allclose(found[~near], expected[~near], rtol=0, atol=0.5)
    assert np.mean(np.abs(found - expected)) < 0.01


def test_way_since_the_turning_point(rng):
    zigzag = np.array([0.0, 1.0, 2.0, 1.5, 0.5, 0.7, 1.0, 0.2])
    expected = [0.0, 0.0, 0.0, -0.5, 0.0, 0.2, 0.0, -0.8]
    assert np.allclose(since_turning(zigzag[:, None])[:, 0], expected)
    between = zigzag[np.repeat(np.arange(8), 30)] + rng.uniform(-4e-4, 4e-4, 240)  # rounded there and back
    assert np.allclose(since_turning(between[:, None])[30::60, 0], expected[1::2], atol=1e-3)
    assert not since_turning(np.full((5, 2), 700.0)).any()


def test_both_ends_of_the_travel_have_opposite_spikes_and_each_strut_its_own(reference):
    motion = run(PLACE, TILT, step_deg=0.25)
    # Greatest value of (1 - exp(-d / r)) exp(-d / l), where its derivative is zero.
    ratio = 2 * 0.003 / 0.2
    greatest = 3.0 / (1 + ratio) * (ratio / (1 + ratio)) ** ratio
    for i in range(6):
        spikes = spike_um(reference, motion, 3.0 * np.eye(6)[i])
        assert not np.delete(spikes, i, axis=1).any()
        assert spikes[:, i].max() == pytest.approx(greatest, rel=0.02)
        assert spikes[:, i].min() == pytest.approx(-greatest, rel=0.02)


def test_both_directions_have_it_on_either_side_with_one_sign(reference):
    """At the end of its travel a strut that sticks is too long, whichever way the circle goes."""
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


def test_it_is_compensated(reference):
    values = np.array([2.0, -1.0, 3.0, 2.0, 1.0, 2.5, 0.1])
    model = MachineModel(reference, (Fitted(SPIKE, values),))
    wanted = replace(run(PLACE, TILT, step_deg=0.5), kept=slice(None))
    commanded = compensated(model, wanted)
    assert np.abs(commanded - wanted.poses)[:, :3].max() > 1e-3
    assert np.allclose(model.actual_poses(replace(wanted, poses=commanded)), wanted.poses, rtol=0, atol=1e-8)


def test_single_poses_are_refused(reference, rng):
    with pytest.raises(ModelError, match="reversal-spike needs path"):
        spike_um(reference, replace(random_run(rng), is_path=False), 3.0)
