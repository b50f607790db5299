"""One commanded circle: place, travel, poses."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.computing.arrays import Floats

FULL_TURN_DEG = 360.0

USUAL_STROKE_MM = 10.0
"""Travel of a bar's gauge in each direction if neither instrument nor session states it [mm]. One bar measures circles
of 150 and 144 mm radius, so it is at least 6; up to 50 still distinguishes bars of 100 and 150 mm."""


class Direction(StrEnum):
    """Sense of travel, seen from +Z."""

    CCW = "ccw"
    CW = "cw"

    @property
    def sign(self) -> float:
        """Return +1 for rising angles, -1 for falling."""
        return 1.0 if self is Direction.CCW else -1.0


@dataclass(frozen=True)
class Circle:
    """A horizontal circle of the tool tip about a fixed ball, with a level or raised bar.

    A bar raised by e gives the radius R cos e, at the height R sin e above the ball.

    Attributes:
        ball_mm: planned place of the fixed ball, machine frame (x, y, z).
        centre_mm: as programmed, machine frame (x, y, z).
        bar_mm: nominal ball distance R.
        tilt_deg: constant (A, B, C).
        start_deg: of the full turn, from +X towards +Y.
        feed_in_mm: length of the radial move onto the circle.
    """

    ball_mm: tuple[float, float, float]
    centre_mm: tuple[float, float, float]
    bar_mm: float
    tilt_deg: tuple[float, float, float]
    feed_mm_min: float
    start_deg: float
    overshoot_deg: float
    feed_in_mm: float
    elevation_deg: float
    direction: Direction

    @property
    def radius_mm(self) -> float:
        """Return the path's radius, R cos e [mm]."""
        return self.bar_mm * float(np.cos(np.radians(self.elevation_deg)))

    @property
    def turning_deg_s(self) -> float:
        """Return the angular speed, always positive [deg/s]."""
        return float(np.degrees(self.feed_mm_min / 60.0 / self.radius_mm))

    @property
    def feeding_s(self) -> float:
        """Return the time of feed-in or feed-out at the planned feed [s]."""
        return self.feed_in_mm / (self.feed_mm_min / 60.0)

    @property
    def swept_deg(self) -> float:
        """Return the arc between feed-in and feed-out [deg]."""
        return FULL_TURN_DEG + 2.0 * self.overshoot_deg

    def theta_deg(self, phi_deg: Floats) -> Floats:
        """Return the angle from +X towards +Y at progress `phi_deg`, 0 at the start [deg]."""
        return self.start_deg + self.direction.sign * phi_deg

    def phi_deg(self, theta_deg: Floats) -> Floats:
        """Return progress at an angle, 0 to 360 [deg], the inverse of `theta_deg`."""
        return np.mod(self.direction.sign * (theta_deg - self.start_deg), FULL_TURN_DEG)

    def poses(self, theta_deg: Floats, outside_mm: float = 0.0) -> Floats:
        """Return commanded poses at angles, shape (n, 6) [mm, deg]."""
        theta, elevation = np.radians(theta_deg), np.radians(self.elevation_deg)
        radius = self.radius_mm + outside_mm * np.cos(elevation)
        x, y, z = self.centre_mm
        height = np.full_like(theta, z + outside_mm * np.sin(elevation))
        tilt = np.broadcast_to(self.tilt_deg, (len(theta), 3))
        return np.column_stack([x + radius * np.cos(theta), y + radius * np.sin(theta), height, tilt])

    def envelope(self, step_deg: float = 1.0) -> Floats:
        """Return poses of the whole path, feed-in and feed-out included, shape (n, 6) [mm, deg]."""
        count = int(np.ceil(self.swept_deg / step_deg)) + 1
        arc = self.poses(self.theta_deg(np.linspace(-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg, count)))
        ends = self.theta_deg(np.array([-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg]))
        outside = self.poses(ends, self.feed_in_mm)
        return np.vstack([outside[:1], arc, outside[1:]])


_S_PER_MIN = 60.0


def circle_s(circle: Circle) -> float:
    """Return the time of feed-in, turn, overshoots and feed-out, without dwells and ramps [s]."""
    feeding_mm = 2.0 * circle.feed_in_mm
    return circle.swept_deg / circle.turning_deg_s + feeding_mm / (circle.feed_mm_min / _S_PER_MIN)


def circles_s(circles: Iterable[Circle]) -> float:
    """Return the time of several circles, without set-ups [s]."""
    return sum(circle_s(circle) for circle in circles)
