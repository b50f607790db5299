"""Where a circle lies and how it is travelled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.plan.plan import Circle, Direction

LEVEL = Circle((10, 20, -1000), (10, 20, -1000), 150, (5, -3, 0), 1000, 30, 45, 1.5, 0, Direction.CCW)


def raised(elevation):
    height = 150 * np.sin(np.radians(elevation))
    return replace(LEVEL, elevation_deg=elevation, centre_mm=(10, 20, -1000 + height))


def test_every_point_is_a_bar_length_from_the_ball():
    for circle in (LEVEL, raised(5), raised(-8)):
        poses = circle.poses(np.linspace(0, 360, 37))
        assert np.allclose(np.linalg.norm(poses[:, :3] - circle.ball_mm, axis=1), 150)
        assert np.allclose(poses[:, 3:], [5, -3, 0])
        assert np.allclose(poses[:, 2], circle.centre_mm[2])


def test_feed_in_stands_outside_along_the_bar():
    circle = raised(5)
    inside, outside = circle.poses(np.array([70.0])), circle.poses(np.array([70.0]), 1.5)
    bar = inside[0, :3] - circle.ball_mm
    assert np.allclose(outside[0, :3] - inside[0, :3], 1.5 * bar / 150)


def test_angles_fall_with_time_clockwise():
    clockwise = replace(LEVEL, direction=Direction.CW)
    assert np.allclose(clockwise.theta_deg(np.array([0.0, 90.0])), [30, -60])
    assert np.allclose(clockwise.phi_deg(np.array([-60.0, 300.0])), 90)
    assert np.allclose(LEVEL.phi_deg(np.array([120.0, -240.0])), 90)


def test_turning_speed_is_feed_over_radius():
    assert LEVEL.turning_deg_s == pytest.approx(np.degrees(1000 / 60 / 150))
    assert raised(60).turning_deg_s == pytest.approx(np.degrees(1000 / 60 / 75))


def test_the_envelope_covers_arcs_and_feed_in():
    envelope = LEVEL.envelope()
    radius = np.hypot(envelope[:, 0] - 10, envelope[:, 1] - 20)
    assert radius.max() == pytest.approx(151.5)
    angles = np.unwrap(np.arctan2(envelope[:, 1] - 20, envelope[:, 0] - 10))
    assert np.degrees(np.ptp(angles)) == pytest.approx(450)
