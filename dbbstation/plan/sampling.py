"""What an instrument that takes so many readings a second sees of a circle at its feed."""

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
    """Readings on one turn.

    Attributes:
        points_per_turn: readings while the machine goes once round.
        highest_undulation: per revolution; what has more looks like something slower, and is not told apart from it.
    """

    points_per_turn: float
    spacing_deg: float
    highest_undulation: int

    @property
    def enough(self) -> bool:
        """Whether the figures of a circle are seen as far as they go."""
        return self.highest_undulation >= UNDULATIONS

    @property
    def is_circle(self) -> bool:
        """Whether there are points enough to take the recording for a circle at all."""
        return self.points_per_turn >= SMALLEST_POINTS


def sampling(circle: Circle, rate_hz: float) -> Sampling:
    """Return what is seen of a circle."""
    points = rate_hz * FULL_TURN_DEG / circle.turning_deg_s
    return Sampling(points, FULL_TURN_DEG / points, int(points / POINTS_PER_UNDULATION))


def enough_feed_mm_min(circle: Circle, rate_hz: float) -> float:
    """Return the greatest feed at which the figures are seen as far as they go [mm/min].

    Args:
        circle: its radius counts.
    """
    return circle.feed_mm_min * sampling(circle, rate_hz).points_per_turn / (UNDULATIONS * POINTS_PER_UNDULATION)
