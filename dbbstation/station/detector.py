"""Detect begin and end of a circle in the readings, since no control reports its motion to a ball bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.trace.cut import FEED_TOLERANCE

if TYPE_CHECKING:
    from dbbstation.plan.plan import Circle

AGREEING = 3
"""Number of successive readings on one side before the side counts, so that one misread line is no movement."""

HYSTERESIS = 0.1
"""Share of the feed-in, about its middle, that belongs to neither side."""

CORNER_DWELL_S = 0.3
"""Assumed stop of controls between feed-in and arc [s]; only the live display uses it."""

DWELL_BEHIND_S = 0.5
"""Time that is recorded after the feed-out, so that its edge has both sides [s]."""


def feed_out_due_s(circle: Circle) -> float:
    """Return the time between the edges of feed-in and feed-out at the plan's feed, plus the tolerance of cutting [s]."""
    return (1.0 + FEED_TOLERANCE) * circle.swept_s + circle.feeding_s + 2.0 * CORNER_DWELL_S


@dataclass(frozen=True)
class Patience:
    """The station's longest waiting times, in machine time.

    Attributes:
        for_machine_s: for the bar to reach the feed-in point, and then for the feed-in.
        turn_factor: for a turn, in units of the circle's time at its feed.
    """

    for_machine_s: float = 600.0
    turn_factor: float = 1.5
    turn_extra_s: float = 20.0

    def for_turn_s(self, circle: Circle) -> float:
        """Return the longest time between feed-in and feed-out [s]."""
        return self.turn_factor * circle.swept_s + self.turn_extra_s


SETTLED_S = 2.0
"""Time at the circle's length that indicates a machine [s]; a bar that is put in by hand passes it faster."""


class CircleWatch:
    """Detects a machine that moves on a circle without recording, from readings in time order."""

    def __init__(self, circle: Circle, *, waits_for_feed_in: bool) -> None:
        self._edges = EdgeDetector(circle)
        self._far_mm = circle.bar_mm - circle.feed_in_mm / 2.0
        self._since_s: float | None = None
        self._came = not waits_for_feed_in
        self._told = False
        self._mirrored_mm = circle.bar_mm - circle.feed_in_mm
        self._reach_mm = (0.5 - HYSTERESIS) * circle.feed_in_mm
        self.backwards = False
        """Whether the length changed in the wrong direction before the circle, as with an inverted gauge."""

    def seen(self, t_s: float, length_mm: float) -> bool:
        """Return True once, when the bar has kept the circle's length for `SETTLED_S`."""
        outside = self._edges.outside(length_mm)
        if outside is True:
            self.backwards = False
        elif abs(length_mm - self._mirrored_mm) < self._reach_mm:
            self.backwards = True
        if outside is not False or length_mm < self._far_mm:
            self._since_s = None
            self._came = self._came or outside is True
            return False
        if self._since_s is None:
            self._since_s = t_s
        if self._told or not self._came or t_s - self._since_s < SETTLED_S:
            return False
        self._told = True
        return True


class EdgeDetector:
    """Detects on which side of the feed-in's middle the bar is, from readings in time order."""

    def __init__(self, circle: Circle) -> None:
        middle = circle.bar_mm + circle.feed_in_mm / 2.0
        self._outside_mm = middle + HYSTERESIS * circle.feed_in_mm
        self._inside_mm = middle - HYSTERESIS * circle.feed_in_mm
        self._side: bool | None = None
        self._agreeing = 0

    def outside(self, length_mm: float) -> bool | None:
        """Return True for outside, False for inside, None while the last readings disagree."""
        side = None
        if length_mm > self._outside_mm:
            side = True
        elif length_mm < self._inside_mm:
            side = False
        self._agreeing = self._agreeing + 1 if side is self._side and side is not None else int(side is not None)
        self._side = side
        return side if self._agreeing >= AGREEING else None


def live_phi_deg(circle: Circle, since_feed_in_s: float) -> float:
    """Return the progress after the feed-in edge, within a degree or two [deg]."""
    feed_in_rest_s = circle.feeding_s / 2.0
    on_arc_s = max(since_feed_in_s - feed_in_rest_s - CORNER_DWELL_S, 0.0)
    return min(on_arc_s * circle.turning_deg_s, circle.swept_deg) - circle.overshoot_deg


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
