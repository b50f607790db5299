"""Print circles against the shop's tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.reporting.tolerances import EvaluatedTolerance, WorstRun


def which_circles(tests: Sequence[str], directions: Sequence[str]) -> str:
    """Return the circles of a tolerance: no test means all, no direction both."""
    named = f"tests {', '.join(tests)}" if tests else "every test"
    return named + (f", {', '.join(directions)} only" if directions else "")


def print_tolerances(held: Sequence[EvaluatedTolerance], origin: str) -> None:
    """Print the worst run of every tolerance."""
    from dbbstation.cli.output import print_table

    if not held:
        return
    echo()
    echo(
        f"tolerances [µm], from {origin}; the worst run of each, readings under the nominal machine and under the model"
    )
    rows = []
    for one in held:
        worst = [_told(each) for each in (one.before, one.after)]
        rows.append(
            [
                one.quantity,
                which_circles(one.tests, one.directions),
                f"{one.largest_um:g}",
                *(t for pair in worst for t in pair),
            ]
        )
    print_table(["quantity", "circles", "at most", "nominal machine", "", "model", ""], rows)


def _told(worst: WorstRun | None) -> tuple[str, str]:
    if worst is None:
        return "-", "no such run"
    return f"{worst.worst_um:.1f}", f"{worst.run}, {'within' if worst.within else 'EXCEEDED'}"
