"""Check the bar's place before a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.station.detector import HYSTERESIS

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle


@dataclass(frozen=True)
class BarAtFeedIn:
    """The bar's position at the feed-in point.

    Attributes:
        long_mm: reading less the length at the feed-in point.
        seated: whether the sequence accepts it: nearer than half the feed-in, less the detector's margin.
        backwards: on the opposite side, as with an inverted gauge.
    """

    long_mm: float
    seated: bool
    backwards: bool = False


def seat(length_mm: float, circle: Circle) -> BarAtFeedIn:
    """Return the bar's position relative to the feed-in point of the next circle."""
    long_mm = length_mm - (circle.bar_mm + circle.feed_in_mm)
    margin_mm = (0.5 - HYSTERESIS) * circle.feed_in_mm
    return BarAtFeedIn(long_mm, abs(long_mm) < margin_mm, abs(long_mm + 2.0 * circle.feed_in_mm) < margin_mm)
