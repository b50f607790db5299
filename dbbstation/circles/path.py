"""A circle's filtered path about the ball, in its plane."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.inference.harmonics import smooth
from dbbstation.trace.analysis import BallPath, best_circle, horizontal_radius_mm, measured_path, path_about_ball
from dbbstation.trace.gaussian import gaussian, transmission
from dbbstation.trace.minimum_zone import MinimumZone, minimum_zone

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.trace.recording import RawCircle


class Filter(IntEnum):
    """Filter with a cut-off in undulations per revolution (UPR): Gaussian, but sharp at 30 for predictions and tolerances."""

    NONE = 0
    UPR_15 = 15
    UPR_30 = 30
    UPR_50 = 50
    UPR_150 = 150

    @classmethod
    def of_word(cls, word: str) -> Filter:
        """Return the filter for an option's value: a cut-off, or `none`."""
        return cls(0 if word == "none" else int(word))

    @property
    def words(self) -> str:
        """Return its description beside figures."""
        if self is Filter.UPR_30:
            return "30 UPR, cut off sharply"
        return f"Gaussian, {self.value} UPR" if self else "none"

    def passed(self, undulations: Floats) -> Floats:
        """Return the transmitted amplitude of undulations, shape (k,)."""
        if not self:
            return np.ones(len(undulations))
        if self is Filter.UPR_30:
            return np.where(undulations <= self.value, 1.0, 0.0)
        return transmission(undulations, self.value)

    def through(self, theta_deg: Floats, values: Floats) -> Floats:
        """Return filtered deviations of a full turn, shape (n,)."""
        if not self:
            return values
        if self is Filter.UPR_30:
            highest = min(self.value, max(len(values) // SAMPLES_PER_UNDULATION, 2))
            return smooth(values, np.radians(theta_deg), highest)
        return gaussian(theta_deg, values, self.value)


TOLERATED = Filter.UPR_30
"""Filter of the circular deviation for tolerances, as in the predictions of `evaluate`."""


SAMPLES_PER_UNDULATION = 4
"""Least samples per undulation of the sharp filter."""


@dataclass(frozen=True, eq=False)
class CirclePath:
    """The path of one direction or both, in the circle's plane.

    Lengths of a raised bar become distances from the ball's vertical, because its circle is horizontal with radius R cos e.

    Attributes:
        theta_deg: about the ball, from +X towards +Y, shape (n,).
    """

    radius_mm: float
    theta_deg: Floats
    about_ball_mm: Floats
    least_squares: BallPath

    @property
    def points_mm(self) -> Floats:
        """Return the path's points relative to the ball, shape (n, 2) [mm]."""
        theta = np.radians(self.theta_deg)
        return np.column_stack([self.about_ball_mm * np.cos(theta), self.about_ball_mm * np.sin(theta)])

    def zone(self) -> MinimumZone:
        """Return the minimum zone."""
        return minimum_zone(self.points_mm)


def path_of(raw: RawCircle, chosen: Filter = Filter.NONE) -> CirclePath:
    """Return a raw circle's path.

    The filter changes deviations from the least-squares circle, but neither centre nor radius.

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
    """Join two paths about their common least-squares circle, with equal weights.

    Raises:
        TraceError: as `path_of`.
    """
    theta_deg = np.linspace(0.0, FULL_TURN_DEG, max(len(one.theta_deg), len(other.theta_deg)), endpoint=False)
    even = [np.interp(theta_deg, path.theta_deg, path.about_ball_mm, period=FULL_TURN_DEG) for path in (one, other)]
    centre, radius, _ = best_circle(np.tile(theta_deg, 2), np.concatenate(even))
    theta_deg = np.concatenate([one.theta_deg, other.theta_deg])
    about_ball = np.concatenate([one.about_ball_mm, other.about_ball_mm])
    theta = np.radians(theta_deg)
    deviation = np.hypot(about_ball * np.cos(theta) - centre[0], about_ball * np.sin(theta) - centre[1]) - radius
    return CirclePath(one.radius_mm, theta_deg, about_ball, BallPath(theta_deg, centre, float(radius), deviation))
