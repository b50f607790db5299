"""`dbbstation diagnose`: which physics a calibration leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.exclude import exclude_option
from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.diagnosis.unexplained_model import Kept

STAGES = {
    "kinematic calibration": 0,
    "candidates": 10,
    "joint fit": 45,
    "verdicts": 75,
    "held-out tests": 77,
    "next test": 80,
}
"""Stages that a diagnosis tells, and how much of its time has passed about then [%]; joint fits are none or several."""


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--sources", metavar="A,B,...", help="Sources to look for, in place of all that are known.")
@source_file_option
@exclude_option
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the joint model here.")
@click.option(
    "--keep-unexplained",
    is_flag=True,
    help="Keep in that model what has no name, as a curve over strut length or force: compensated, cause unknown.",
)
@figure_option()
@click.option("--force", is_flag=True, help="Overwrite the model file and the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def diagnose(
    sessions: tuple[Path, ...],
    *,
    sources: str | None,
    source_files: tuple[Path, ...],
    exclude: tuple[str, ...],
    out: Path | None,
    keep_unexplained: bool,
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
      dbbstation diagnose 2026-11-20-hexapod-7 --out kept.yaml --keep-unexplained
    """
    from dbbstation.calibration.evaluation import evaluate
    from dbbstation.calibration.summary import calibration_summary, identified_model
    from dbbstation.cli.calibrate import ELSEWHERE_IN_MODEL
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.unknown_causes import say_unknown_causes
    from dbbstation.diagnosed import diagnose_sessions
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.files.models import write_model
    from dbbstation.files.own_sources import every_source

    if keep_unexplained and out is None:
        raise click.UsageError("--keep-unexplained keeps it in the model of --out: give that too")
    for path in filter(None, (out, figure)):
        refuse_existing(path, force=force)
    candidates = [name.strip() for name in sources.split(",")] if sources else None
    known = every_source(source_files)
    with stage_bar("diagnosis", STAGES, plain=as_json) as progress:
        diagnosed = diagnose_sessions(sessions, candidates, exclude, say, known, progress)
    found, summary = diagnosed.diagnosis, diagnosed.summary()
    if out is not None:
        unnamed = _kept(found) if keep_unexplained else None
        fit = found.after if unnamed is None else unnamed.fit
        calibrated = calibration_summary(fit, evaluate(fit.model, fit.observations))
        kept = {key: value for key, value in calibrated.items() if key not in ELSEWHERE_IN_MODEL}
        of_sessions = diagnosed.recorded.sessions
        model = identified_model(fit, kept, of_sessions) if unnamed is None else unnamed.identified(kept, of_sessions)
        write_model(out, model, force=force)
        say_unknown_causes(model.model)
    if figure is not None:
        from dbbstation.report.diagnosis_figure import diagnosis_figure

        write_bytes(figure, diagnosis_figure(found, format_of(figure)), force=force)
        say(f"figure written to {figure}")
    if as_json:
        print_json(summary)
    else:
        _print(summary)
        if out is not None:
            say(f"joint model written to {out}")


UNPREDICTABLE_UM = 1000.0
"""A prediction that is off by more says that nothing was predicted [µm]."""


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
    _print_gain(summary)
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
    if summary["unexplained"]["curve"]:
        _print_curve(summary["unexplained"]["curve"])
    if not summary["second_start_agrees"]:
        click.echo(
            "A second search came to another set of causes: several explain these recordings, take it with care."
        )
    _print_next_tests(summary)


STILL_OPEN = frozenset({"ambiguous", "not-testable"})


def _print_next_tests(summary: Mapping[str, Any]) -> None:
    """Print the tests that would settle what is open; that there are none where nothing would; nothing where all is settled."""
    if summary["next_test"]:
        tests = [summary["next_test"], *summary["further_tests"]]
        together = "it" if len(tests) == 1 else f"these {len(tests)} together"
        click.echo(
            f"measure next: {'; and '.join(test['text'] for test in tests)}; {together} would tell {tests[0]['source']} to "
            f"{tests[-1]['sigma_after']:.2g} instead of {tests[0]['sigma_before']:.2g} {tests[0]['unit']}"
        )
    elif any(source["verdict"] in STILL_OPEN and source["gain"] is not None for source in summary["sources"]):
        click.echo(
            "measure next: no single further test would change a verdict or halve an uncertainty, nor would three"
        )


def _kept(found: Diagnosis) -> Kept | None:
    """What is left without a name, to be kept in the model; None, and why, where it cannot be."""
    from dbbstation.cli.output import say
    from dbbstation.diagnosis.unexplained_model import keep_unexplained
    from dbbstation.errors import ModelError

    try:
        return keep_unexplained(found.unexplained.curve, found.after)
    except ModelError as error:
        say(f"note: the model is written without it: {error.what}")
        return None


MOST_POINTS = 12
"""Points of a curve that are printed; a wave has many more, and is said by its size and period."""


def _print_curve(curve: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    points = curve["points"]
    click.echo(
        f"it moves the readings by {curve['readings_um']:.2f} µm rms, {curve['unconcealed_um']:.2f} µm of that where no "
        "kinematic parameter can follow; cause unknown:"
    )
    if curve["period_mm"] is not None:
        click.echo(
            f"  a wave of {curve['period_mm']:.2f} mm, from {points[0]['at']:.0f} to {points[-1]['at']:.0f} mm, up to "
            f"{max(abs(point['value_um']) for point in points):.2f} µm"
        )
    elif curve["form"]:
        click.echo(f"  {curve['form']}")
    step = -(-len(points) // MOST_POINTS)
    rows = [[f"{p['at']:.6g}", f"{p['value_um']:+.2f}", "±", f"{p['uncertainty_um']:.2f}"] for p in points[::step]]
    print_table([f"{curve['variable']} / {curve['unit']}", "error / µm", "", "std / µm"], rows)
    if curve["convention"]:
        click.echo(f"  ({curve['convention']})")


def _print_gain(summary: Mapping[str, Any]) -> None:
    """Print residual and prediction of left-out tests before and after."""
    residual, held_out = summary["residual_rms_um"], summary["held_out_rms_um"]
    click.echo(f"\nresidual within mountings {residual['before']:.2f} -> {residual['after']:.2f} µm rms")
    normalised = summary["held_out_normalised"]
    if max(held_out.values()) > UNPREDICTABLE_UM:
        click.echo("left-out tests cannot be predicted from the others: too few tests to know the machine without them")
    else:
        click.echo(
            f"left-out tests, predicted {held_out['before']:.2f} -> {held_out['after']:.2f} µm rms; in units of what "
            f"noise and uncertainties allow {normalised['before']:.2f} -> {normalised['after']:.2f}"
        )


def _print_sources(sources: Sequence[Mapping[str, Any]]) -> None:
    from dbbstation.cli.output import print_table

    rows = []
    for source in sources:
        hidden = "" if source["concealed"] is None else f"{100 * source['concealed']:.0f} %"
        gain = "" if source["gain"] is None else str(round(source["gain"]))
        again = "" if source["stability"] is None else f"{100 * source['stability']:.0f} %"
        alike = ", ".join(source["ambiguous_with"] or source["class"][1:])
        rows.append([source["name"], source["verdict"], _probable(source), gain, hidden, again, alike])
    titles = [
        "cause",
        "verdict",
        "probability",
        "log Bayes factor",
        "concealed",
        "selection frequency",
        "not told from",
    ]
    print_table(titles, rows)
    for source in sources:
        if source["verdict"] in {"identified", "ambiguous"}:
            click.echo()
            for name, number in source["parameters"].items():
                value, uncertainty = f"{number['value']:.4g}", f"{number['uncertainty']:.2g}"
                click.echo(f"{source['name']}: {name} {value} ± {uncertainty} {number['unit']}")
            click.echo(f"  {source['text']}")


def _probable(source: Mapping[str, Any]) -> str:
    """Probability as printed: no figure is closer to one or nought than the catalogue of causes is complete."""
    if source["probability"] is None:
        return ""
    surest = 0.999
    return f"> {surest}" if source["probability"] > surest else f"{source['probability']:.3f}"
