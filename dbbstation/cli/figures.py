"""The table of circles before and after [CAL Table III]."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import echo, print_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.reporting.evaluation import EvaluatedRun

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
