"""What can be known to go wrong is found before anything starts: travel and feed-in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan


def check_plan(plan: Plan, machine: Machine, *, file: str) -> None:
    """Dry-run a plan.

    Args:
        plan: what is to be measured.
        machine: nominal machine.
        file: of the plan, for messages.

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
