"""The path of one circle as its figures are taken from it: about the ball, in its plane, filtered."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import smooth
from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.analysis import BallPath, best_circle, horizontal_radius_mm, measured_path, path_about_ball
from dbbstation.trace.gaussian import gaussian, transmission
from dbbstation.trace.minimum_zone import MinimumZone, minimum_zone

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.trace.circle import RawCircle


class Filter(IntEnum):
    """Cut-off in undulations per revolution (UPR): Gaussian, but for 30, which is the sharp one of predictions and tolerances."""

    NONE = 0
    UPR_15 = 15
    UPR_30 = 30
    UPR_50 = 50
    UPR_150 = 150

    @property
    def words(self) -> str:
        """As it is written beside a figure."""
        if self is Filter.UPR_30:
            return "30 UPR, cut off sharply"
        return f"Gaussian, {self.value} UPR" if self else "none"

    def passed(self, undulations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of the amplitude of undulations that passes, shape (k,)."""
        if not self:
            return np.ones(len(undulations))
        if self is Filter.UPR_30:
            return np.where(undulations <= self.value, 1.0, 0.0)
        return transmission(undulations, self.value)

    def through(self, theta_deg: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return deviations of a full turn as the filter passes them, at the same angles, shape (n,)."""
        if not self:
            return values
        if self is Filter.UPR_30:
            highest = min(self.value, max(len(values) // SAMPLES_PER_UNDULATION, 2))
            return smooth(values, np.radians(theta_deg), highest)
        return gaussian(theta_deg, values, self.value)


SAMPLES_PER_UNDULATION = 4
"""Samples per undulation that the sharp filter passes, at the least."""


@dataclass(frozen=True, eq=False)
class CirclePath:
    """One circle, or both directions of one, in the plane of the circle.

    The circle of a raised bar is horizontal too, with the radius R cos e: lengths along the bar are turned into distances
    from the vertical through the fixed ball, whatever the tilt of the platform.

    Attributes:
        radius_mm: nominal radius of the tool tip's path, R cos e [mm].
        theta_deg: angles about the ball, from +X towards +Y, shape (n,) [deg].
        about_ball_mm: distances from the vertical through the ball, shape (n,) [mm].
    """

    radius_mm: float
    theta_deg: NDArray[np.float64]
    about_ball_mm: NDArray[np.float64]
    least_squares: BallPath

    @property
    def points_mm(self) -> NDArray[np.float64]:
        """Points of the path from the ball, shape (n, 2) [mm]."""
        theta = np.radians(self.theta_deg)
        return np.column_stack([self.about_ball_mm * np.cos(theta), self.about_ball_mm * np.sin(theta)])

    def zone(self) -> MinimumZone:
        """The two concentric circles of least separation that hold the path."""
        return minimum_zone(self.points_mm)


def path_of(raw: RawCircle, chosen: Filter = Filter.NONE) -> CirclePath:
    """Return the path of a raw circle.

    The filter sees deviations from the least-squares circle, so that it takes nothing from centre and radius.

    Raises:
        TraceError: the points do not determine a circle.
    """
    about_ball = horizontal_radius_mm(raw, raw.length_mm)
    path = measured_path(raw)
    if chosen:
        about_ball = about_ball - path.deviation_mm + chosen.through(path.theta_deg, path.deviation_mm)
        path = path_about_ball(raw.theta_deg, about_ball)
    return CirclePath(raw.circle.radius_mm, path.theta_deg, about_ball, path)


def both(one: CirclePath, other: CirclePath) -> CirclePath:
    """Return two paths of one circle as one, with the least-squares circle of both.

    Both are given at their angles about the ball already; they count alike, however many points each has.

    Raises:
        TraceError: the points do not determine a circle.
    """
    theta_deg = np.linspace(0.0, FULL_TURN_DEG, max(len(one.theta_deg), len(other.theta_deg)), endpoint=False)
    even = [np.interp(theta_deg, path.theta_deg, path.about_ball_mm, period=FULL_TURN_DEG) for path in (one, other)]
    centre, radius, _ = best_circle(np.tile(theta_deg, 2), np.concatenate(even))
    theta_deg = np.concatenate([one.theta_deg, other.theta_deg])
    about_ball = np.concatenate([one.about_ball_mm, other.about_ball_mm])
    theta = np.radians(theta_deg)
    deviation = np.hypot(about_ball * np.cos(theta) - centre[0], about_ball * np.sin(theta) - centre[1]) - radius
    return CirclePath(one.radius_mm, theta_deg, about_ball, BallPath(theta_deg, centre, radius, deviation))
