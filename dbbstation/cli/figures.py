"""Figures of circles: as files, as tables, and against the shop's tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import echo, print_table
from dbbstation.cli.provenance import provenance

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.calibration.reporting.evaluation import EvaluatedRun, EvaluatedTolerance, WorstRun
    from dbbstation.report.figure_format import Stamped


def format_of(path: Path) -> Stamped:
    """Return the format of a path with its provenance."""
    from dbbstation.report.figure_format import FigureFormat, Stamped

    return Stamped(FigureFormat(path.suffix.lower()), provenance())


def known_format(path: Path) -> Path:
    """Return a path after checking its extension, before any work.

    Raises:
        ValueError: the name ends otherwise.
    """
    from dbbstation.report.figure_format import FigureFormat

    if path.suffix.lower() not in set(FigureFormat):
        ending = f"`{path.suffix}` is no format of figures" if path.suffix else f"`{path.name}` has no ending"
        raise ValueError(f"{ending}; let the name end in {', '.join(FigureFormat)}")
    return path


G_WITH_NOISE = "G: greatest minus least deviation from the least-squares circle [ISO 230-4], the bar's noise included"
G_LOW_PASSED = (
    "G: greatest minus least deviation from the least-squares circle [ISO 230-4], readings low-passed at 30 undulations "
    "per revolution"
)
"""Two definitions of circular deviation G in tables. In a good circle the first is mostly noise, about six times its
standard deviation. Only the second is comparable with a prediction, which has no noise."""


def print_runs(runs: Sequence[EvaluatedRun], *, low_passed: bool = False) -> None:
    """Print centre deviation, mean radial error and circular deviation of every run, before and after."""
    echo("             centre deviation     mean radial error  circular deviation G  [µm]")
    titles = ["test", "dir", "n", "before", "after", " before", " after", "  before", "  after"]
    rows = []
    for run in runs:
        both = (run.before, run.after)
        bent = [of.circularity_um for of in both]
        if low_passed and run.circularity_30_upr_um is not None:
            bent = [run.circularity_30_upr_um.before, run.circularity_30_upr_um.after]
        rows.append(
            [
                run.test,
                run.direction,
                run.repeat,
                *(of.centre_deviation_um for of in both),
                *(of.mean_radial_error_um for of in both),
                *bent,
            ]
        )
    print_table(titles, rows)
    echo(G_LOW_PASSED if low_passed else G_WITH_NOISE)


def which_circles(tests: Sequence[str], directions: Sequence[str]) -> str:
    """Return the circles of a tolerance: no test means all, no direction both."""
    named = f"tests {', '.join(tests)}" if tests else "every test"
    return named + (f", {', '.join(directions)} only" if directions else "")


def print_tolerances(held: Sequence[EvaluatedTolerance], origin: str) -> None:
    """Print the worst run of every tolerance."""
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
