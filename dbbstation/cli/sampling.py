"""Check an instrument's rate against a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.plan.plan import Plan
    from dbbstation.results.sampling import SampledCircle


def sampled_circles(plan: Plan, protocol: Protocol, baud: int | None = None) -> tuple[SampledCircle, ...]:
    """Return the instrument's readings of each circle of a plan."""
    from dbbstation.plan.sampling import enough_feed_mm_min, sampling
    from dbbstation.results.sampling import SampledCircle

    rate_hz = protocol.fastest_hz(baud)
    found = []
    for name, test in plan.tests.items():
        seen = sampling(test.circle, rate_hz)
        found.append(
            SampledCircle(
                test=name,
                feed_mm_min=test.circle.feed_mm_min,
                readings_per_second=rate_hz,
                points_per_turn=seen.points_per_turn,
                spacing_deg=seen.spacing_deg,
                highest_undulation=seen.highest_undulation,
                enough=seen.enough,
                is_circle=seen.is_circle,
                greatest_feed_mm_min=enough_feed_mm_min(test.circle, rate_hz),
            )
        )
    return tuple(found)


def sampling_notes(plan: Plan, protocol: Protocol, baud: int | None = None) -> Iterator[str]:
    """Yield sentences on the plan and on circles that are too fast for the instrument."""
    from dbbstation.plan.sampling import SMALLEST_POINTS, UNDULATIONS

    circles = sampled_circles(plan, protocol, baud)
    slowest = min(circles, key=lambda one: one.points_per_turn)
    yield (
        f"{protocol.label} takes {slowest.readings_per_second:.3g} readings per second: at least "
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


def say_sampling(plan: Plan, protocol: Protocol, baud: int | None) -> None:
    """Print the instrument's readings of the circles."""
    for note in sampling_notes(plan, protocol, baud):
        say(f"note: {note}")
