"""`dbbstation diagnose`: which physics a calibration leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--sources", metavar="A,B,...", help="Sources to look for, in place of all that are known.")
@source_file_option
@click.option("--exclude", multiple=True, metavar="TEST", help="Leave a test out; may be given more than once.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the joint model here.")
@click.option("--figure", type=click.Path(path_type=Path, dir_okay=False), help="Write a figure here, as SVG.")
@click.option("--force", is_flag=True, help="Overwrite the model file and the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def diagnose(
    sessions: tuple[Path, ...],
    *,
    sources: str | None,
    source_files: tuple[Path, ...],
    exclude: tuple[str, ...],
    out: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Find the physics that a kinematic calibration of these recordings leaves out, name it and model it.

    A calibration can hide gravity, drift or play in its joints: the residual then looks fine here and is wrong
    elsewhere. This fits the kinematic parameters again with every candidate, lets the evidence decide, and says what
    cannot be told. Verdicts: identified, ambiguous, ruled-out, not-testable.

    \b
    Examples:
      dbbstation diagnose 2026-11-20-hexapod-7
      dbbstation diagnose 2026-11-20-hexapod-7 --out joint.yaml --figure diagnosis.svg
      dbbstation diagnose 2026-11-20-hexapod-7 --sources gravity,backlash --json
      dbbstation diagnose 2026-11-20-hexapod-7 --source-file scale_bow.py
    """
    from dbbstation.calibration.evaluation import evaluate
    from dbbstation.calibration.summary import calibration_summary, identified_model
    from dbbstation.cli.calibrate import ELSEWHERE_IN_MODEL
    from dbbstation.cli.output import print_json, say
    from dbbstation.diagnosed import diagnose_sessions
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.files.models import write_model
    from dbbstation.files.own_sources import every_source

    for path in (out, figure):
        if path is not None:
            refuse_existing(path, force=force)
    candidates = [name.strip() for name in sources.split(",")] if sources else None
    diagnosed = diagnose_sessions(sessions, candidates, exclude, say, every_source(source_files))
    found, summary = diagnosed.diagnosis, diagnosed.summary()
    if out is not None:
        calibrated = calibration_summary(found.after, evaluate(found.after.model, found.after.observations))
        kept = {key: value for key, value in calibrated.items() if key not in ELSEWHERE_IN_MODEL}
        write_model(out, identified_model(found.after, kept, diagnosed.recorded.sessions), force=force)
    if figure is not None:
        from dbbstation.report.diagnosis_figure import diagnosis_figure

        write_bytes(figure, diagnosis_figure(found), force=force)
        say(f"figure written to {figure}")
    if as_json:
        print_json(summary)
    else:
        _print(summary)
        if out is not None:
            say(f"joint model written to {out}")


def _print(summary: Mapping[str, Any]) -> None:
    if summary["mismatch"]:
        click.echo(
            f"The recordings differ from the kinematic model by {summary['misfit_rms_um']:.2f} µm rms beyond noise "
            f"(probability by chance {summary['probability']:.1g})."
        )
    else:
        click.echo(f"The recordings agree with the kinematic model (probability {summary['probability']:.2g}).")
    click.echo()
    for outlier in summary["outliers"]:
        click.echo(f"does not belong, kept from pulling the fits: {outlier['text']}")
    _print_sources(summary["sources"])
    if summary["locations"]:
        click.echo("\nwhere the misfit is largest:")
        for location in summary["locations"][:5]:
            click.echo(f"  {location['text']} ({100 * location['share']:.0f} % of it)")
    residual, held_out = summary["residual_rms_um"], summary["held_out_rms_um"]
    click.echo(f"\nresidual within mountings {residual['before']:.2f} -> {residual['after']:.2f} µm rms")
    normalised = summary["held_out_normalised"]
    click.echo(
        f"left-out tests, predicted {held_out['before']:.2f} -> {held_out['after']:.2f} µm rms; in units of what "
        f"noise and uncertainties allow {normalised['before']:.2f} -> {normalised['after']:.2f}"
    )
    if summary["workspace"]:
        elsewhere = summary["workspace"]
        click.echo(
            f"over the workspace the earlier calibration was off by {elsewhere['error_rms_um']:.1f} µm rms, "
            f"{elsewhere['error_greatest_um']:.1f} µm at most; the joint model is uncertain by "
            f"{elsewhere['uncertainty_rms_um']:.1f} µm"
        )
    if summary["parameter_shift"]:
        click.echo("the earlier calibration had been pulled, most of all:")
        for shift in summary["parameter_shift"][:4]:
            click.echo(f"  {shift['parameter']}: {shift['shift_um']:+.0f} µm")
    click.echo(summary["unexplained"]["text"])
    if summary["next_test"]:
        test = summary["next_test"]
        click.echo(
            f"measure next: {test['text']}; it would tell {test['source']} to {test['sigma_after']:.2g} instead of "
            f"{test['sigma_before']:.2g} {test['unit']}"
        )


def _print_sources(sources: Sequence[Mapping[str, Any]]) -> None:
    from dbbstation.cli.output import print_table

    rows = []
    for source in sources:
        hidden = "" if source["concealed"] is None else f"{100 * source['concealed']:.0f} %"
        gain = "" if source["gain"] is None else f"{source['gain']:.0f}"
        again = "" if source["stability"] is None else f"{100 * source['stability']:.0f} %"
        alike = ", ".join(source["ambiguous_with"])
        rows.append([source["name"], source["verdict"], gain, hidden, again, alike])
    print_table(["source", "verdict", "log evidence", "concealed", "again", "not told from"], rows)
    for source in sources:
        if source["verdict"] in {"identified", "ambiguous"}:
            click.echo()
            for name, number in source["parameters"].items():
                value, uncertainty = f"{number['value']:.4g}", f"{number['uncertainty']:.2g}"
                click.echo(f"{source['name']}: {name} {value} ± {uncertainty} {number['unit']}")
            click.echo(f"  {source['text']}")
