"""The readings of an instrument on a plan's circles."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SampledCircle:
    """The readings of an instrument on one circle.

    Attributes:
        spacing_deg: between readings.
    """

    test: str
    feed_mm_min: float
    readings_per_second: float
    points_per_turn: float
    spacing_deg: float
    highest_undulation: int
    enough: bool
    is_circle: bool
    greatest_feed_mm_min: float
