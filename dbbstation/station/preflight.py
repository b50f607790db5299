"""What can be known to go wrong is found before anything starts: travel, feed-in, range of the instrument."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan


def check_plan(plan: Plan, machine: Machine, *, file: str) -> None:
    """Dry-run a plan.

    Raises:
        InputError: a test whose begin and end the readings cannot show; every such test is named.
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
    """Hold the lengths of a plan's circles against what an instrument reads.

    Raises:
        InputError: a circle or its feed-in lies outside; every such test is named.
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
