"""Durations of circles at planned feeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.plan.circle import Circle

_S_PER_MIN = 60.0


def circle_s(circle: Circle) -> float:
    """Return the time of feed-in, turn, overshoots and feed-out, without dwells and ramps [s]."""
    feeding_mm = 2.0 * circle.feed_in_mm
    return circle.swept_deg / circle.turning_deg_s + feeding_mm / (circle.feed_mm_min / _S_PER_MIN)


def circles_s(circles: Iterable[Circle]) -> float:
    """Return the time of several circles, without set-ups [s]."""
    return sum(circle_s(circle) for circle in circles)
