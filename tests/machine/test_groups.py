"""Poses are worked on in groups side by side: none may notice its neighbours, and the solution stays sound at poor poses."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import KinematicsError
from dbbstation.machine.geometry import Frames, Hexapod
from dbbstation.machine.kernels import LANES
from dbbstation.machine.kinematics import bar_sensitivity, forward, inverse, strut_jacobian, strut_lengths

BALL = np.array([20.0, -35.0, -1010.0])


@pytest.fixture
def hexapod(reference):
    return reference.hexapod


@pytest.fixture
def actual(hexapod, rng):
    return hexapod.moved(rng.normal(0, 0.1, (6, 3)), rng.normal(0, 0.1, (6, 3)))


def some_frames(hexapod, rng, count):
    poses = rng.uniform([-150, -150, -1180, -15, -15, -4], [150, 150, -860, 15, 15, 4], (count, 6))
    return Frames.from_poses(poses, hexapod.rotation)


def part(frames, rows):
    return Frames(frames.position_mm[rows].copy(), frames.rotation[rows].copy())


@pytest.mark.parametrize("count", [1, LANES - 1, LANES, LANES + 1, 3 * LANES + 7])
def test_a_pose_does_not_notice_its_neighbours(hexapod, actual, rng, count):
    frames = some_frames(hexapod, rng, count)
    lengths = strut_lengths(hexapod, frames)
    together = forward(actual, lengths, frames)
    sensitivity = bar_sensitivity(actual, together, BALL)
    for n in {0, count // 2, count - 1}:
        alone = forward(actual, lengths[n : n + 1], part(frames, slice(n, n + 1)))
        assert np.array_equal(alone.position_mm[0], together.position_mm[n])
        assert np.array_equal(alone.rotation[0], together.rotation[n])
        single = bar_sensitivity(actual, alone, BALL)
        assert np.array_equal(single.response.per_parameter[0], sensitivity.response.per_parameter[n])


def test_poses_found_have_the_lengths_and_are_rotations(hexapod, actual, rng):
    frames = some_frames(hexapod, rng, 5000)
    lengths = strut_lengths(hexapod, frames)
    found = forward(actual, lengths, frames)
    assert np.abs(strut_lengths(actual, found) - lengths).max() < 1.1e-11
    square = found.rotation @ np.swapaxes(found.rotation, 1, 2)
    assert np.abs(square - np.eye(3)).max() < 1e-14


def test_lengths_alone_are_those_with_directions(hexapod, rng):
    frames = some_frames(hexapod, rng, 100)
    assert np.allclose(strut_lengths(hexapod, frames), inverse(hexapod, frames).length_mm, rtol=0.0, atol=1e-12)


def nearly_loose(hexapod, distances):
    """Poses along the way to one where the struts hold nothing: a quarter turn about Z from the middle, less a bit."""
    poses = np.zeros((len(distances), 6))
    poses[:, 2], poses[:, 5] = -1008.0, 90.0 - np.asarray(distances)
    return Frames.from_poses(poses, hexapod.rotation)


def test_poor_poses_are_solved_as_well_as_their_condition_allows(hexapod):
    frames = nearly_loose(hexapod, [10.0, 1.0, 0.1, 0.01, 1e-3, 1e-4])
    jacobian = strut_jacobian(inverse(hexapod, frames))
    condition = np.linalg.cond(jacobian)
    assert condition[-1] > 1e7
    sensitivity = bar_sensitivity(hexapod, frames, BALL)
    right = np.concatenate([sensitivity.direction, np.zeros((len(frames), 3))], axis=1)
    expected = np.linalg.solve(np.swapaxes(jacobian, 1, 2), right[:, :, None])[:, :, 0]
    error = np.abs(sensitivity.response.per_strut - expected).max(axis=1) / np.abs(expected).max(axis=1)
    assert np.all(error < 1e-15 * condition)


def test_forward_kinematics_converges_close_to_a_loose_pose(hexapod):
    wanted, near = nearly_loose(hexapod, [0.01]), nearly_loose(hexapod, [0.0101])
    lengths = strut_lengths(hexapod, wanted)
    found = forward(hexapod, lengths, near)
    assert np.abs(strut_lengths(hexapod, found) - lengths).max() < 1.1e-11


def test_a_platform_on_parallel_struts_is_loose(hexapod, rng):
    joints = hexapod.platform_joints_mm * np.array([1.0, 1.0, 0.0])
    swing = Hexapod(joints, joints)
    frames = Frames.from_poses(np.array([[0.0, 0.0, -900.0, 0.0, 0.0, 0.0]]), swing.rotation)
    with pytest.raises(KinematicsError, match="loose"):
        bar_sensitivity(swing, frames, BALL)
    with pytest.raises(KinematicsError, match="loose"):
        forward(swing, strut_lengths(swing, frames) + 0.1 * rng.normal(size=(1, 6)), frames)


def test_the_first_bad_pose_is_named_wherever_it_stands(hexapod, actual, rng):
    frames = some_frames(hexapod, rng, 5000)
    for bad in (0, LANES, 2500, 4999):
        lengths = strut_lengths(hexapod, frames)
        lengths[bad] = [100, 2000, 100, 2000, 100, 2000]
        with pytest.raises(KinematicsError, match=rf"pose {bad + 1}: "):
            forward(actual, lengths, frames)


def test_a_length_that_is_no_number_is_no_loose_pose(hexapod, rng):
    frames = some_frames(hexapod, rng, 3)
    lengths = strut_lengths(hexapod, frames)
    lengths[1, 4] = np.inf
    with pytest.raises(KinematicsError, match="pose 2: no pose has these strut lengths"):
        forward(hexapod, lengths, frames)


def test_balls_may_move_from_pose_to_pose_but_must_fit(hexapod, rng):
    frames = some_frames(hexapod, rng, 8)
    balls, tools = BALL + rng.normal(0, 0.1, (8, 3)), rng.normal(0, 1.0, (8, 3))
    together = bar_sensitivity(hexapod, frames, balls, tools)
    for n in range(8):
        alone = bar_sensitivity(hexapod, part(frames, slice(n, n + 1)), balls[n], tools[n])
        assert alone.length_mm[0] == together.length_mm[n]
    with pytest.raises(ValueError, match="do not fit 8 poses"):
        bar_sensitivity(hexapod, frames, balls[:5])
