"""Travel limits name the pose and the limit."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import TravelError
from dbbstation.machine.travel import check_travel, is_within_travel, middle, reachable

HOME = np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]])


def pose(**change):
    values = dict(zip("xyzabc", HOME[0], strict=True)) | change
    return np.array([[values[axis] for axis in "xyzabc"]])


def test_the_middle_is_inside(reference):
    check_travel(reference, HOME, where="home")


def test_the_middle_lies_on_the_axis_half_way_and_untilted(reference):
    frames = middle(reference)
    low, high = reference.travel.z_mm
    np.testing.assert_allclose(frames.position_mm, [[0.0, 0.0, (low + high) / 2.0]])
    np.testing.assert_allclose(frames.rotation, np.eye(3)[None], atol=1e-15)


@pytest.mark.parametrize("outside", [[], [0], [2, 3], [1, 4], [0, 1, 2, 3, 4]])
def test_poses_outside_are_left_out_wherever_they_stand(reference, outside):
    poses = np.vstack([pose(x=float(x)) for x in range(5)])
    poses[outside, 2] = 0.0
    inside = [each for each in poses if is_within_travel(reference, each[None])]
    assert len(inside) == 5 - len(outside)
    np.testing.assert_array_equal(reachable(reference, poses), np.reshape(inside, (-1, 6)))


@pytest.mark.parametrize(
    ("outside", "named"),
    [
        (pose(x=290, y=290), "distance from the Z axis is 410"),
        (pose(x=301), "distance from the Z axis is 301"),
        (pose(z=-1209), "Z is -1209"),
        (pose(a=26.5), "A is 26.5"),
        (pose(b=-30), "B is -30"),
        (pose(c=6), "C is 6"),
        (pose(x=float("nan")), "is nan"),
    ],
)
def test_each_limit_is_named_with_its_pose(reference, outside, named):
    with pytest.raises(TravelError, match=named) as refused:
        check_travel(reference, np.vstack([HOME, outside]), where="test q ccw")
    assert "test q ccw, pose 2 of 2" in str(refused.value)


def test_a_pose_where_the_platform_comes_loose_is_refused(reference):
    low, high = np.array([150, -180, -809, 5, 15, 0]), np.array([200, -140, -830, 20, 20, 3])
    poses = np.random.default_rng(3).uniform(np.minimum(low, high), np.maximum(low, high), (20000, 6))
    poses = poses[np.hypot(poses[:, 0], poses[:, 1]) < 290]
    with pytest.raises(TravelError, match="hold of the struts"):
        check_travel(reference, poses, where="corner")
