"""Check travel, feed-in and the instrument's range before anything starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan


def check_plan(plan: Plan, machine: Machine, *, file: str) -> None:
    """Dry-run a plan.

    Raises:
        InputError: readings cannot show a test's begin and end; names every such test.
        TravelError: a circle leaves the machine's travel; names test, direction, pose and limit.
    """
    faults = [
        Problem(
            file,
            0,
            0,
            f"test {test.name} has no feed-in: a recording of it cannot be cut",
            "give `feed_in_mm` in its path, 1.5 mm is usual",
        )
        for test in plan.tests.values()
        if test.circle.feed_in_mm <= 0.0
    ]
    if faults:
        raise InputError(faults)
    plan.check(machine)


def check_range(plan: Plan, range_mm: tuple[float, float], *, file: str) -> None:
    """Check the lengths of a plan's circles against the instrument's range.

    Raises:
        InputError: a circle or feed-in lies outside; names every such test.
    """
    low_mm, high_mm = range_mm
    faults = []
    for test in plan.tests.values():
        bar_mm, outside_mm = test.circle.bar_mm, test.circle.bar_mm + test.circle.feed_in_mm
        if low_mm <= bar_mm and outside_mm <= high_mm:
            continue
        what = (
            f"test {test.name}: the bar goes from {bar_mm:g} to {outside_mm:g} mm with its feed-in, and the instrument"
        )
        remedy = "take an instrument or a profile with more range, or a shorter `feed_in_mm` in its path"
        faults.append(Problem(file, 0, 0, f"{what} reads {low_mm:g} to {high_mm:g} mm", remedy))
    if faults:
        raise InputError(faults)
