"""The undulations that an instrument's sample rate resolves on a circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.plan.circle import FULL_TURN_DEG

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle

UNDULATIONS = 30
"""Highest undulations per revolution in a circle's figures."""

POINTS_PER_UNDULATION = 2.0
"""With fewer points, an undulation is aliased to a lower one [Shannon, 1949]."""

SMALLEST_POINTS = 36
"""With fewer points a turn has gaps above ten degrees and does not count as a circle."""


@dataclass(frozen=True)
class Sampling:
    """Readings on one turn."""

    points_per_turn: float
    spacing_deg: float
    highest_undulation: int

    @property
    def enough(self) -> bool:
        """Return whether all figures are resolved."""
        return self.highest_undulation >= UNDULATIONS

    @property
    def is_circle(self) -> bool:
        """Return whether the points are dense enough for a circle."""
        return self.points_per_turn >= SMALLEST_POINTS


def sampling(circle: Circle, rate_hz: float) -> Sampling:
    """Return how densely a sample rate covers a circle."""
    points = rate_hz * FULL_TURN_DEG / circle.turning_deg_s
    return Sampling(points, FULL_TURN_DEG / points, int(points / POINTS_PER_UNDULATION))


def enough_feed_mm_min(circle: Circle, rate_hz: float) -> float:
    """Return the greatest feed that still resolves all figures [mm/min]."""
    return circle.feed_mm_min * sampling(circle, rate_hz).points_per_turn / (UNDULATIONS * POINTS_PER_UNDULATION)
