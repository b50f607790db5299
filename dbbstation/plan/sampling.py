"""The undulations that an instrument's sample rate resolves on a circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.facts.quantities import FULL_TURN_DEG

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.plan.plan import Circle, Plan

UNDULATIONS = 30
"""Highest undulations per revolution in a circle's figures."""

POINTS_PER_UNDULATION = 2.0
"""With fewer points, an undulation is aliased to a lower one [Shannon, 1949]."""

SMALLEST_POINTS = 36
"""With fewer points a turn has gaps above ten degrees and does not count as a circle."""


@dataclass(frozen=True)
class SampledCircle:
    """The readings of an instrument on one circle.

    Attributes:
        spacing_deg: between readings.
        enough: all figures are resolved.
        is_circle: the points are dense enough for a circle.
        greatest_feed_mm_min: greatest feed that still resolves all figures.
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


def sampled(circle: Circle, rate_hz: float, test: str = "") -> SampledCircle:
    """Return how densely a sample rate covers a circle."""
    points = rate_hz * FULL_TURN_DEG / circle.turning_deg_s
    highest = int(points / POINTS_PER_UNDULATION)
    return SampledCircle(
        test=test,
        feed_mm_min=circle.feed_mm_min,
        readings_per_second=rate_hz,
        points_per_turn=points,
        spacing_deg=FULL_TURN_DEG / points,
        highest_undulation=highest,
        enough=highest >= UNDULATIONS,
        is_circle=points >= SMALLEST_POINTS,
        greatest_feed_mm_min=circle.feed_mm_min * points / (UNDULATIONS * POINTS_PER_UNDULATION),
    )


def sampled_circles(plan: Plan, rate_hz: float) -> tuple[SampledCircle, ...]:
    """Return an instrument's readings of each circle of a plan."""
    return tuple(sampled(test.circle, rate_hz, name) for name, test in plan.tests.items())


def sampling_notes(plan: Plan, label: str, rate_hz: float) -> Iterator[str]:
    """Yield sentences on the plan and on circles that are too fast for the instrument of this label."""
    circles = sampled_circles(plan, rate_hz)
    slowest = min(circles, key=lambda one: one.points_per_turn)
    yield (
        f"{label} takes {slowest.readings_per_second:.3g} readings per second: at least "
        f"{slowest.points_per_turn:.0f} points per turn ({slowest.spacing_deg:.2g}° apart), up to "
        f"{slowest.highest_undulation} undulations per revolution"
    )
    for is_circle in (False, True):
        slow = [one for one in circles if not one.enough and one.is_circle is is_circle]
        if not slow:
            continue
        worst = min(slow, key=lambda one: one.points_per_turn)
        tests = ", ".join(one.test for one in slow)
        what = (
            f"undulations above {worst.highest_undulation} per revolution are not seen, and pass for slower ones"
            if is_circle
            else f"fewer than {SMALLEST_POINTS} points per turn are no circle"
        )
        yield (
            f"too slow for test {tests} at {worst.feed_mm_min:g} mm/min: {what}; for {UNDULATIONS} undulations take at most "
            f"{worst.greatest_feed_mm_min:.0f} mm/min, or a higher baud rate"
        )
