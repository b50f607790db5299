"""`dbbstation calibrate`: fit the machine's errors to recorded sessions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.output import echo
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from dbbstation.calibration.checks.plan_check import PlanCheck
    from dbbstation.calibration.checks.scatter import ScatterCheck
    from dbbstation.results.calibration import CalibrationResult


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option(
    "--sources", metavar="A,B,...", help="Error sources to fit [default: strut-reference-length,base-joints]."
)
@source_file_option
@click.option(
    "--law-over-time",
    is_flag=True,
    help="Fit thermal growth as a function of time, even where temperatures were logged.",
)
@click.option(
    "--method",
    type=click.Choice(["jig", "conv-a", "conv-b"]),
    default="jig",
    show_default=True,
    help="How ball positions are known: from a CMM sheet (jig); not at all (conv-a); from micrometer readings (conv-b).",
)
@click.option(
    "--prescribe",
    metavar="SOURCE.PARAMETER,...",
    help="Parameters to hold at nominal, as many as the tests cannot identify.",
)
@chosen_tests_options
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the calibrated model here.")
@figure_option()
@click.option("--force", is_flag=True, help="Overwrite the model file and the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def calibrate(
    sessions: tuple[Path, ...],
    *,
    sources: str | None,
    source_files: tuple[Path, ...],
    law_over_time: bool,
    method: str,
    prescribe: str | None,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    out: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Fit the machine's errors to the raw circles of one or more sessions.

    Fits 24 kinematic parameters: the reference lengths of the struts and the positions of the base joints. The scatter of
    mountings, CMM and bar enters as random effects. Combinations of parameters that the tests cannot identify are named
    and held at nominal. Balls and runs that are outliers are named and kept out of the fit.

    With --method conv-a or conv-b the balls were put up under the spindle, and their positions are unknown. Six
    combinations cannot be identified then. Six parameters are held at nominal instead; the program chooses them, or
    --prescribe names them.

    \b
    Examples:
      dbbstation calibrate 2026-11-20-hexapod-7
      dbbstation calibrate 2026-11-20-hexapod-7 --out model.yaml --figure circles.svg
      dbbstation calibrate monday tuesday --exclude h --json
      dbbstation calibrate standard-test --method conv-a
      dbbstation calibrate monday --sources strut-reference-length,base-joints,gravity,cog-shift,drive-friction
      dbbstation calibrate monday --source-file scale_bow.py --sources strut-reference-length,base-joints,scale-bow

    With drive-friction among the sources, recorded motor currents are fitted too. They give gains and friction of the
    drives, and with cog-shift the centre of gravity.
    """
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import task_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.atomic import refuse_outputs, write_bytes
    from dbbstation.files.formats.model import write_model
    from dbbstation.files.own_sources import every_source, sources_of
    from dbbstation.tasks.calibrate import STAGES
    from dbbstation.tasks.calibrate import calibrate as calibrated

    refuse_outputs((out, figure), force=force)
    chosen = names_in(sources)
    every = every_source(source_files)
    for name in set(sources_of(source_files, every)) - set(chosen or ()):
        say(f"note: {name} is known now, but not fitted: name it with --sources")
    with task_bar("calibration", STAGES) as progress:
        result = calibrated(
            sessions,
            sources=chosen,
            method=method,
            prescribe=names_in(prescribe),
            tests=tests,
            exclude=exclude,
            law_over_time=law_over_time,
            known=every,
            progress=progress,
            say=lambda text: say(f"note: {text}"),
        )
    if out is not None:
        write_model(out, result.model, provenance=provenance(), force=force)
    if figure is not None and result.drawing is not None:
        write_bytes(figure, result.drawing(format_of(figure)), force=force)
        say(f"figure written to {figure}")
    for outlier in result.outliers:
        say(f"outlier, kept out of the fit: {outlier.text}")
    if as_json:
        print_result(result)
    else:
        _print(result)
        if out is not None:
            say(f"model written to {out}")


def names_in(text: str | None) -> list[str] | None:
    """Return names separated by commas; None without a text."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


IN_A_TABLE_OF_THEIR_OWN = frozenset({"drive-friction"})
"""Sources with a row for each motor in place of one for each parameter."""

IN_MM = frozenset({"cog-shift"})
"""Sources whose lengths are no deviations of the tool."""

NOT_THIS_MACHINE = 10.0
"""Residual over noise above which the machine file itself is in doubt."""


def _print(result: CalibrationResult) -> None:
    from dbbstation.cli.figures import print_runs
    from dbbstation.cli.motors import print_currents

    print_runs(result.runs)
    echo()
    _print_parameters(result)
    echo()
    echo(f"{result.parameters_identified} parameters identified")
    held = "" if result.parameters_prescribed else ", held at nominal"
    for text in result.directions_lost:
        echo(f"not visible to these tests{held}: {text}")
    if result.parameters_prescribed:
        echo(f"held at nominal instead: {', '.join(result.parameters_prescribed)}")
    for text in result.directions_regularised:
        echo(f"not visible to these tests, known by the machine file's joint tolerance only: {text}")
    for text in result.gaps:
        echo(f"  {text}")
    for weak in result.observability.weak_directions[:1]:
        echo(f"least visible, to {weak.uncertainty:.1f} {weak.unit}: {weak.text}")
    if not result.plan_check.enough:
        _print_plan_check(result.plan_check)
    _print_misfit(result)
    for check in result.scatter:
        _print_scatter(check, missing_physics=result.misfit.missing_physics)
    echo(f"nominal machine leaves   {result.nominal_rms_um:8.2f} µm rms")
    echo(f"model leaves             {result.residual_rms_um:8.2f} µm rms")
    echo(f"... within each mounting {result.residual_within_mounting_rms_um:8.2f} µm rms")
    echo(f"noise of one reading     {result.noise_um:8.2f} µm")
    print_currents(result.motor_currents)


def _print_plan_check(check: PlanCheck) -> None:
    echo(
        f"{check.tests} tests are too few to reveal a wrong tilt, height or position in the plan: {check.left} degrees "
        f"of freedom are left to check it, one circle has {check.of_one_test}; a small residual proves nothing here, so "
        "check the tilts by hand or measure further circles"
    )


def _print_misfit(result: CalibrationResult) -> None:
    """Print the residual beyond noise and mountings, unless chance explains it."""
    from dbbstation.results.model_warnings import exceeds

    misfit = result.misfit
    if not misfit.missing_physics:
        return
    echo(
        f"{exceeds(misfit.rms_um, misfit.probability)}: physics is missing from the model; `dbbstation diagnose` looks for it. "
        "Until then its parameters may be off by many times their u"
    )
    if result.residual_within_mounting_rms_um > NOT_THIS_MACHINE * result.noise_um:
        echo(
            f"... more than {NOT_THIS_MACHINE:.0f} times the noise: check also that the machine file is this machine's, its "
            "joints in the order of the struts and the rotation convention that of the control"
        )


def _print_parameters(result: CalibrationResult) -> None:
    from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, print_table
    from dbbstation.text.digits import decimals_of

    rows = []
    for source in result.sources:
        if source.name in IN_A_TABLE_OF_THEIR_OWN:
            continue
        for name, parameter in source.parameters.items():
            value, uncertainty, unit = parameter.value, parameter.uncertainty, parameter.unit
            each = 1.0
            if unit == "mm" and source.name not in IN_MM:
                each, unit = 1e3, "µm"
            cells = [f"{each * value:.1f}", "-", "-"]
            if parameter.is_known:
                u, expanded = each * uncertainty, COVERAGE_FACTOR * each * uncertainty
                cells = [f"{number:.{decimals_of(expanded)}f}" for number in (each * value, u, expanded)]
            rows.append([source.name, name.removesuffix("_mm").replace("_", " "), *cells, unit])
    print_table(["source", "parameter", "value", "u", EXPANDED, "unit"], rows)


SAID_OF_SCATTER = {
    "as-stated": "as stated",
    "less": "less than stated, which is no fault",
    "more": "NOT as stated: another plate or CMM sheet, loose holders, or a wrong convention of tilts in the machine file?",
}
BESIDE_MISSING_PHYSICS = (
    "more than stated: physics that the model lacks is the likelier reason, so run `dbbstation diagnose` before you doubt "
    "plate, CMM sheet or holders"
)


def _print_scatter(check: ScatterCheck, *, missing_physics: bool) -> None:
    stated = f"balls stated to stand within {check.stated_um:.2f} µm per axis"
    if check.fits is None or check.interval_um is None:
        echo(f"{stated}: these tests cannot tell")
        return
    low, high = check.interval_um
    said = SAID_OF_SCATTER[check.finding]
    if missing_physics and check.finding == "more":
        said = BESIDE_MISSING_PHYSICS
    echo(f"{stated} scatter by {check.found_um:.2f} ({low:.2f} to {high:.2f}) µm, {said}")
