"""One ball-bar circle as commanded: where it lies, how it is travelled, which pose belongs to which angle."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FULL_TURN_DEG = 360.0

USUAL_STROKE_MM = 10.0
"""Travel of a bar's gauge either way where neither instrument nor session states it [mm]. One bar serves circles of 150
and 144 mm radius, so it is no less than 6; bars of 100 and 150 mm are distinguished by anything up to 50."""


class Direction(StrEnum):
    """Sense of travel, seen from +Z."""

    CCW = "ccw"
    CW = "cw"

    @property
    def sign(self) -> float:
        """Return +1 where the angle grows with time, -1 where it falls."""
        return 1.0 if self is Direction.CCW else -1.0


@dataclass(frozen=True)
class Circle:
    """A horizontal circle of the tool tip about a fixed ball, with the bar level or raised.

    With elevation e the circle has the radius R cos e and lies R sin e above the ball.

    Attributes:
        ball_mm: centre of the fixed ball as the plan knows it, machine frame (x, y, z) [mm].
        centre_mm: centre of the circle as programmed, machine frame (x, y, z) [mm].
        bar_mm: nominal distance R between the balls [mm].
        tilt_deg: tool orientation (A, B, C), constant over the circle [deg].
        feed_mm_min: speed of the tool tip along its path [mm/min].
        start_deg: angle where the full turn starts, from +X towards +Y [deg].
        overshoot_deg: arc travelled before and after the full turn [deg].
        feed_in_mm: how far outside the circle the feed-in starts, along the bar [mm].
        direction: sense of travel.
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
        """Radius of the tool tip's path, R cos e [mm]."""
        return self.bar_mm * float(np.cos(np.radians(self.elevation_deg)))

    @property
    def turning_deg_s(self) -> float:
        """Angular speed, always positive [deg/s]."""
        return float(np.degrees(self.feed_mm_min / 60.0 / self.radius_mm))

    @property
    def swept_deg(self) -> float:
        """Whole arc between feed-in and feed-out [deg]."""
        return FULL_TURN_DEG + 2.0 * self.overshoot_deg

    def theta_deg(self, phi_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angle from +X towards +Y at the progress `phi_deg` along the turn (0 at its start) [deg]."""
        return self.start_deg + self.direction.sign * phi_deg

    def phi_deg(self, theta_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        """Progress along the turn at an angle, from 0 up to 360 [deg]; the inverse of `theta_deg`."""
        return np.mod(self.direction.sign * (theta_deg - self.start_deg), FULL_TURN_DEG)

    def poses(self, theta_deg: NDArray[np.float64], outside_mm: float = 0.0) -> NDArray[np.float64]:
        """Commanded poses at angles, shape (n, 6) [mm, deg].

        Args:
            theta_deg: angles from +X towards +Y, shape (n,) [deg].
            outside_mm: how far the tool tip stands outside the circle, along the bar [mm].
        """
        theta, elevation = np.radians(theta_deg), np.radians(self.elevation_deg)
        radius = self.radius_mm + outside_mm * np.cos(elevation)
        x, y, z = self.centre_mm
        height = np.full_like(theta, z + outside_mm * np.sin(elevation))
        tilt = np.broadcast_to(self.tilt_deg, (len(theta), 3))
        return np.column_stack([x + radius * np.cos(theta), y + radius * np.sin(theta), height, tilt])

    def envelope(self, step_deg: float = 1.0) -> NDArray[np.float64]:
        """Poses that cover the whole path, feed-in and feed-out included, shape (n, 6) [mm, deg]."""
        count = int(np.ceil(self.swept_deg / step_deg)) + 1
        arc = self.poses(self.theta_deg(np.linspace(-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg, count)))
        ends = self.theta_deg(np.array([-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg]))
        outside = self.poses(ends, self.feed_in_mm)
        return np.vstack([outside[:1], arc, outside[1:]])
