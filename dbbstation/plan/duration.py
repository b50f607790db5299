"""How long circles take at their planned feeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.plan.circle import Circle

_S_PER_MIN = 60.0


def circle_s(circle: Circle) -> float:
    """Time that the machine moves for a circle: feed-in, turn with both overshoots, feed-out, all at its feed [s].

    Dwells and what the control takes to speed up and slow down are not in it.
    """
    feeding_mm = 2.0 * circle.feed_in_mm
    return circle.swept_deg / circle.turning_deg_s + feeding_mm / (circle.feed_mm_min / _S_PER_MIN)


def circles_s(circles: Iterable[Circle]) -> float:
    """Time that the machine moves for several circles [s]; putting up balls and driving from one to the next is not in it."""
    return sum(circle_s(circle) for circle in circles)
