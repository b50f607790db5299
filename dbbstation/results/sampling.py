"""What an instrument sees of the circles of a plan."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SampledCircle:
    """What an instrument sees of one circle.

    Attributes:
        test: name of its test.
        feed_mm_min: of the circle.
        readings_per_second: of the instrument.
        points_per_turn: readings in a turn.
        spacing_deg: angle between two readings.
        highest_undulation: highest number of undulations per revolution that is seen.
        enough: whether that is as high as figures need.
        is_circle: whether the points make a circle at all.
        greatest_feed_mm_min: at which the instrument would see enough.
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
