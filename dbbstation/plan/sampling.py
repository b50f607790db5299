"""What an instrument's rate shows of a circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.plan.circle import FULL_TURN_DEG

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle

UNDULATIONS = 30
"""Undulations per revolution that figures of a circle are told up to."""

POINTS_PER_UNDULATION = 2.0
"""Fewer make an undulation look like a slower one [Shannon, 1949]."""

SMALLEST_POINTS = 36
"""A turn with fewer has gaps of more than ten degrees between its points, and is no circle any more."""


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
        """Return whether the points make a circle."""
        return self.points_per_turn >= SMALLEST_POINTS


def sampling(circle: Circle, rate_hz: float) -> Sampling:
    """Return what is seen of a circle."""
    points = rate_hz * FULL_TURN_DEG / circle.turning_deg_s
    return Sampling(points, FULL_TURN_DEG / points, int(points / POINTS_PER_UNDULATION))


def enough_feed_mm_min(circle: Circle, rate_hz: float) -> float:
    """Return the greatest feed with resolved figures [mm/min]."""
    return circle.feed_mm_min * sampling(circle, rate_hz).points_per_turn / (UNDULATIONS * POINTS_PER_UNDULATION)
