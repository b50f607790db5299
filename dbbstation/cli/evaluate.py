"""`dbbstation evaluate`: circle by circle, what a model leaves of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.output import echo
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.reporting.evaluation import EvaluatedRun


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--model", required=True, type=click.Path(path_type=Path), help="Model file of `calibrate`.")
@source_file_option
@chosen_tests_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def evaluate(
    sessions: tuple[Path, ...],
    *,
    model: Path,
    source_files: tuple[Path, ...],
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    as_json: bool,
) -> None:
    r"""Compare recordings with the nominal machine (before) and with a model (after), which must be of the same machine.

    After is what the model leaves of the recordings, not a new measurement. The second table shows the circular
    deviation G that was measured and the one that the model predicts. In both tables G is that of readings low-passed at
    30 undulations per revolution. Flatness over X, Y = ±190 mm and parallelism of a move along X are what the model
    predicts of programs that are not compensated. Tolerances of the shop's settings are held against every circle.

    \b
    Examples:
      dbbstation evaluate check-session --model model.yaml
      dbbstation evaluate check-session --model model.yaml --json
    """
    from dbbstation.cli.figures import print_runs
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import task_bar
    from dbbstation.cli.shop import shop_settings
    from dbbstation.cli.tolerances import print_tolerances
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.evaluate import STAGES
    from dbbstation.tasks.evaluate import evaluate as evaluated

    settings = shop_settings()
    with task_bar("evaluation", STAGES) as progress:
        result = evaluated(
            sessions,
            model,
            tests=tests,
            exclude=exclude,
            tolerances=settings.tolerances,
            known=every_source(source_files),
            progress=progress,
            say=lambda text: say(f"note: {text}"),
        )
    if as_json:
        print_result(result)
        return
    print_runs(result.runs, low_passed=True)
    echo()
    _print_predicted(result.runs)
    echo()
    echo(f"nominal machine leaves {result.nominal_rms_um:8.2f} µm rms")
    echo(f"model leaves           {result.residual_rms_um:8.2f} µm rms")
    echo(f"uncompensated at Z {result.plane_z_mm:.0f} mm, over X, Y = ±190 mm, as the model predicts:")
    if result.plane_without:
        echo(f"(without {', '.join(result.plane_without)}: no pose alone says what they do)")
    for label, value_um, u_um in (
        ("flatness           ", result.flatness_um, result.flatness_u_um),
        ("parallelism along X", result.parallelism_um, result.parallelism_u_um),
    ):
        known = "u not known" if u_um is None else f"u {u_um:.1f} µm"
        echo(f"{label}    {value_um:8.1f} µm   {known}")
    if result.plane_uncertainty_not_known_because:
        echo(f"  ({result.plane_uncertainty_not_known_because})")
    print_tolerances(result.tolerances or (), settings.tolerances_from)


def _print_predicted(runs: Sequence[EvaluatedRun]) -> None:
    from dbbstation.cli.output import print_table

    rows: list[list[object]] = []
    for run in runs:
        circular = run.circularity_30_upr_um
        if circular is None:
            continue
        off = circular.predicted - circular.measured
        share = f"{100 * off / circular.measured:.0f}" if circular.measured else "-"
        rows.append([run.test, run.direction, run.repeat, circular.measured, circular.predicted, off, share])
    echo("circular deviation G up to 30 undulations per revolution [µm]")
    print_table(["test", "dir", "n", "measured", "predicted", "difference", "%"], rows)
