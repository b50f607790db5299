"""`dbbstation evaluate`: circle by circle, what a model leaves of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping

from dbbstation.cli.source_files import source_file_option


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
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import count_bar
    from dbbstation.cli.shop import shop_settings
    from dbbstation.cli.tolerances import held_against, print_tolerances
    from dbbstation.evaluated import evaluated
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.own_sources import every_source
    from dbbstation.machine.difference import check_model_is_of
    from dbbstation.recorded import load_sessions

    settings = shop_settings()
    identified = read_model(model, every_source(source_files))
    with count_bar("reading runs") as reading:
        recorded = load_sessions(sessions, exclude, reading, tests)
    check_model_is_of(recorded.machine, identified.model.machine)
    for warning in recorded.warnings:
        say(f"note: {warning}")
    with count_bar("predicting runs") as predicting:
        summary = evaluated(identified, recorded, predicting)
    summary["tolerances"] = held_against(settings, summary)
    if as_json:
        print_json(summary)
        return
    print_runs(summary, low_passed=True)
    echo()
    _print_predicted(summary)
    echo()
    echo(f"nominal machine leaves {summary['nominal_rms_um']:8.2f} µm rms")
    echo(f"model leaves           {summary['residual_rms_um']:8.2f} µm rms")
    echo(f"uncompensated at Z {summary['plane_z_mm']:.0f} mm, over X, Y = ±190 mm, as the model predicts:")
    if summary["plane_without"]:
        echo(f"(without {', '.join(summary['plane_without'])}: no pose alone says what they do)")
    for label, figure in (("flatness           ", "flatness"), ("parallelism along X", "parallelism")):
        u_um = summary[f"{figure}_u_um"]
        known = "u not known" if u_um is None else f"u {u_um:.1f} µm"
        echo(f"{label}    {summary[f'{figure}_um']:8.1f} µm   {known}")
    if summary["plane_uncertainty_not_known_because"]:
        echo(f"  ({summary['plane_uncertainty_not_known_because']})")
    print_tolerances(summary["tolerances"], settings.tolerances_from)


def _print_predicted(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    rows: list[list[object]] = []
    for run in summary["runs"]:
        measured, predicted = (run["circularity_30_upr_um"][of] for of in ("measured", "predicted"))
        off = predicted - measured
        share = f"{100 * off / measured:.0f}" if measured else "-"
        rows.append([run["test"], run["direction"], run["repeat"], measured, predicted, off, share])
    echo("circular deviation G up to 30 undulations per revolution [µm]")
    print_table(["test", "dir", "n", "measured", "predicted", "difference", "%"], rows)
