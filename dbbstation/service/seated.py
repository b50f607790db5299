"""Whether the bar stands where a run begins, before anything is recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.station.detector import HYSTERESIS

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle


@dataclass(frozen=True)
class BarAtFeedIn:
    """How the bar stands at the feed-in point.

    Attributes:
        long_mm: reading less what it reads there, bar and feed-in [mm].
        seated: whether the sequence takes it for standing there: on the far side of the middle of the feed-in,
            by the margin of its detector.
        backwards: whether it stands as far on the other side of the circle: where a gauge that counts the wrong way round has it.
    """

    long_mm: float
    seated: bool
    backwards: bool = False


def seat(length_mm: float, circle: Circle) -> BarAtFeedIn:
    """Return how the bar stands at the feed-in point of a circle.

    Args:
        circle: that is run next.
    """
    long_mm = length_mm - (circle.bar_mm + circle.feed_in_mm)
    margin_mm = (0.5 - HYSTERESIS) * circle.feed_in_mm
    return BarAtFeedIn(long_mm, abs(long_mm) < margin_mm, abs(long_mm + 2.0 * circle.feed_in_mm) < margin_mm)
