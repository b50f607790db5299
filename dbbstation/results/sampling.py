"""What an instrument sees of the circles of a plan."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SampledCircle:
    """What an instrument sees of one circle.

    Attributes:
        spacing_deg: angle between two readings.
        enough: whether that is as high as figures need.
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
