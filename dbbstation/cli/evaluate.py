"""`dbbstation evaluate`: the residual of recordings under a model, circle by circle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import command
from dbbstation.cli.output import echo, print_runs, print_table, print_tolerances
from dbbstation.cli.shop import shop_settings
from dbbstation.results.words import evaluated_sentence
from dbbstation.tasks.evaluate import evaluate as task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.reporting.evaluation import EvaluatedRun
    from dbbstation.results.calibration import EvaluationResult


def show(result: EvaluationResult) -> None:
    """Print the residual of the model, and the tolerances."""
    print_runs(result.runs, low_passed=True)
    echo()
    _print_predicted(result.runs)
    echo(f"\nnominal machine leaves {result.nominal_rms_um:8.2f} µm rms")
    echo(f"model leaves           {result.residual_rms_um:8.2f} µm rms")
    echo(f"uncompensated at Z {result.plane_z_mm:.0f} mm, over X, Y = ±190 mm, as the model predicts:")
    if result.plane_without:
        echo(f"(without {', '.join(result.plane_without)}: their effect does not follow from the pose alone)")
    for label, value_um, u_um in (
        ("flatness           ", result.flatness_um, result.flatness_u_um),
        ("parallelism along X", result.parallelism_um, result.parallelism_u_um),
    ):
        known = "u not known" if u_um is None else f"u {u_um:.1f} µm"
        echo(f"{label}    {value_um:8.1f} µm   {known}")
    if result.plane_uncertainty_not_known_because:
        echo(f"  ({result.plane_uncertainty_not_known_because})")
    print_tolerances(result.tolerances or (), shop_settings().tolerances_from)
    echo(evaluated_sentence(result))


def _print_predicted(runs: Sequence[EvaluatedRun]) -> None:
    rows: list[list[object]] = []
    for run in runs:
        circular = run.circularity_30_upr_um
        if circular is None:
            continue
        off = circular.predicted - circular.measured
        share = f"{100 * off / circular.measured:.0f}" if circular.measured else "-"
        rows.append([*run.key, circular.measured, circular.predicted, off, share])
    echo("circular deviation G up to 30 undulations per revolution [µm]")
    print_table("test, dir, n, measured, predicted, difference, %", rows)


evaluate = command(task, show, more=lambda: {"tolerances": shop_settings().tolerances})
