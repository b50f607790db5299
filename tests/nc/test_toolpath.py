"""Ways, times and samples of a toolpath."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import TravelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.nc.reach import check_reach
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RAPID_MM_MIN, RowKind, ToolpathBuilder, bits_of, rounded

HOME = np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0])


def moved(**axes: float) -> np.ndarray:
    pose = HOME.copy()
    for axis, value in axes.items():
        pose["XYZABC".index(axis)] += value
    return pose


@pytest.fixture
def path():
    builder = ToolpathBuilder("x")
    builder.say(RowKind.COMMENT, "hello")
    builder.rapid(HOME)
    builder.feed(moved(X=30, Y=40)[None], 3000.0)
    builder.dwell(2.0)
    builder.feed(moved(X=30, Y=40, A=6)[None], 360.0)
    builder.rapid(moved(X=30, Y=40, A=6, Z=50))
    return builder.built()


def test_times_and_ways(path):
    np.testing.assert_allclose(path.duration_s, [0.0, 0.0, 1.0, 2.0, 1.0, 60.0 * 50.0 / RAPID_MM_MIN])
    np.testing.assert_allclose(np.cumsum(path.tip_mm), [0, 0, 50, 50, 50, 100])
    np.testing.assert_array_equal(path.poses[0], HOME)


def test_samples_by_time(path):
    times = path.at_time(np.array([-1.0, 0.5, 1.0, 2.5, 3.5, 99.0]))
    np.testing.assert_allclose(
        times,
        [HOME, moved(X=15, Y=20), *[moved(X=30, Y=40)] * 2, moved(X=30, Y=40, A=3), moved(X=30, Y=40, A=6, Z=50)],
    )


def test_the_first_move_from_a_known_place_has_a_way():
    builder = ToolpathBuilder("x", start=HOME)
    builder.feed(moved(Z=10)[None], 600.0)
    path = builder.built()
    assert path.tip_mm[0] == 10.0
    np.testing.assert_allclose(path.at_time(np.array([0.0, 0.5])), [HOME, moved(Z=5)])


def test_subdivision_ends_at_every_programmed_pose(path):
    row, share = path.subdivided(7.0, 1.0)
    poses = path.between(row, share)
    for index in range(1, len(path)):
        np.testing.assert_array_equal(poses[row == index][-1], path.poses[index])
    assert np.linalg.norm(np.diff(poses[row == 2][:, :3], axis=0), axis=1).max() <= 7.0
    assert np.count_nonzero(row == 4) == 6


def test_rounding_costs_less_than_two_nanometres(rng):
    poses = rng.uniform(-500.0, 500.0, (1000, 6))
    off = rounded(poses) - poses
    assert np.linalg.norm(off[:, :3], axis=1).max() < 0.9e-6
    assert np.radians(np.abs(off[:, 3:])).max() * 1000.0 < 0.9e-6


def test_travel_is_checked_between_the_points(reference):
    builder = ToolpathBuilder("across")
    builder.rapid(moved(X=-280))
    builder.feed(moved(Y=-280)[None], 100.0)
    builder.feed(np.stack([moved(X=290), moved(X=290, Y=100)]), 100.0)
    with pytest.raises(TravelError, match="across: the distance from the Z axis is 300"):
        check_reach(reference, builder.built())


def test_a_start_outside_is_told_at_the_line_that_commands_it(reference):
    """Lines before it name a tool and an offset; the offset that is not stated may be what is wrong."""
    path = read_program("%\nG21 G90 G94\nT1 M6\nG54\nF1000\nG0 X0 Y0 Z10 A0 B0 C0\nG1 X10\nM30\n%\n", "part.ngc")
    with pytest.raises(TravelError, match=r"part\.ngc:6: Z is 10\.000 mm") as refused:
        check_reach(reference, path)
    assert "state work offsets" in str(refused.value.remedy)


def test_a_strut_that_is_too_short_in_the_middle_of_a_move_is_found(reference):
    turned = ToolpathBuilder("steep")
    turned.rapid(moved(Y=170, Z=190, A=23, B=11))
    turned.feed(moved(X=-140, Y=170, Z=140, A=-24, B=6)[None], 100.0)
    path = turned.built()
    row, share = path.subdivided(0.5, 0.5)
    frames = Frames.from_poses(path.between(row, share), reference.hexapod.rotation)
    length = inverse(reference.hexapod, frames).length_mm
    shortest, at_ends = length.min(), length[[0, -1]].min()
    assert shortest < at_ends - 90.0
    limits = (float(shortest + at_ends) / 2.0, 1380.0)
    with pytest.raises(TravelError, match="strut"):
        check_reach(replace(reference, travel=replace(reference.travel, strut_mm=limits)), path)


def test_axes_are_bits_from_x_as_the_lowest():
    assert bits_of(np.array([True, False, True, False, False, True])) == 0b100101
