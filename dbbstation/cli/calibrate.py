"""`dbbstation calibrate`: fit the machine's errors to recorded sessions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Mapping


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option(
    "--sources", metavar="A,B,...", help="Error sources to fit, in place of strut-reference-length,base-joints."
)
@click.option("--exclude", multiple=True, metavar="TEST", help="Leave a test out; may be given more than once.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the calibrated model here.")
@click.option("--force", is_flag=True, help="Overwrite the model file.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def calibrate(
    sessions: tuple[Path, ...],
    *,
    sources: str | None,
    exclude: tuple[str, ...],
    out: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Fit the machine's errors to the raw circles of one or more sessions.

    Fits 24 kinematic parameters, reference lengths of the struts and places of the base joints, with the scatter of
    mountings, CMM and bar as random effects. Directions that the tests cannot see are named and held at nominal.

    \b
    Examples:
      dbbstation calibrate 2026-11-20-hexapod-7
      dbbstation calibrate 2026-11-20-hexapod-7 --out model.yaml
      dbbstation calibrate monday tuesday --exclude h --json
    """
    from dbbstation.calibration.evaluation import evaluate
    from dbbstation.calibration.fit import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, machine_sources
    from dbbstation.calibration.fit import calibrate as fit
    from dbbstation.calibration.summary import calibration_summary, identified_model
    from dbbstation.cli.output import print_json, say
    from dbbstation.errors import ModelError
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.models import write_model
    from dbbstation.recorded import load_sessions
    from dbbstation.sources.registry import sources_named

    if out is not None:
        refuse_existing(out, force=force)
    chosen = KINEMATIC_SOURCES if sources is None else tuple(filter(None, map(str.strip, sources.split(","))))
    fitted = sources_named(dict.fromkeys(chosen + MEASUREMENT_SOURCES))
    if not machine_sources(fitted):
        raise ModelError(
            "none of the error sources named belongs to the machine: there is nothing to calibrate",
            remedy=f"name one such as {KINEMATIC_SOURCES[0]}, or leave --sources out",
        )
    recorded = load_sessions(sessions, exclude)
    for warning in recorded.warnings:
        say(f"note: {warning}")
    calibration = fit(recorded.machine, recorded.observations, fitted)
    summary = calibration_summary(calibration, evaluate(calibration.model, recorded.observations))
    if out is not None:
        kept = {key: value for key, value in summary.items() if key not in ELSEWHERE_IN_MODEL}
        write_model(out, identified_model(calibration, kept, recorded.sessions), force=force)
    for run in summary["doubtful_runs"]:
        say(
            f"doubtful: test {run['test']} {run['direction']} {run['repeat']} leaves {run['residual_um']:.1f} µm rms, far "
            "more than the others; another circle's samples or a ball that moved? Leave it out with --exclude"
        )
    if as_json:
        print_json(summary)
    else:
        _print(summary)
        if out is not None:
            say(f"model written to {out}")


MORE_THAN_NOISE = 1.2
"""Residual over noise above which something smooth must be left."""

ELSEWHERE_IN_MODEL = frozenset({"sources", "measurement_effects", "directions_lost"})
"""Parts of the summary that the model file holds in places of their own."""


def _print(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.figures import print_runs
    from dbbstation.cli.output import print_table

    print_runs(summary)
    click.echo()
    rows = []
    for source in summary["sources"]:
        for name, number in source["parameters"].items():
            value, uncertainty, unit = number["value"], number["uncertainty"], number["unit"]
            if unit == "mm":
                value, uncertainty, unit = 1e3 * value, 1e3 * uncertainty, "µm"
            rows.append([source["name"], name.removesuffix("_mm").replace("_", " "), value, "±", uncertainty, unit])
    print_table(["source", "parameter", "value", "", "std", "unit"], rows)
    click.echo()
    click.echo(f"{summary['parameters_identified']} parameters identified")
    for text in summary["directions_lost"]:
        click.echo(f"not visible to these tests, held at nominal: {text}")
    click.echo(f"nominal machine leaves   {summary['nominal_rms_um']:8.2f} µm rms")
    click.echo(f"model leaves             {summary['residual_rms_um']:8.2f} µm rms")
    click.echo(f"... within each mounting {summary['residual_within_mounting_rms_um']:8.2f} µm rms")
    click.echo(f"noise of one reading     {summary['noise_um']:8.2f} µm")
    if summary["residual_within_mounting_rms_um"] > MORE_THAN_NOISE * summary["noise_um"]:
        click.echo("more is left than noise: `dbbstation diagnose` says which physics may be missing")
