"""`dbbstation diagnose`: find the physics that a calibration leaves out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import CommandOutput, command, figure, save
from dbbstation.cli.effects import SAID, cancelling_text, print_locations, probability_text
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, echo_each, print_table, say
from dbbstation.facts.digits import expanded_uncertainty, with_uncertainty
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.words import ending_sentences, mismatch_sentence, outlier_sentence
from dbbstation.tasks.declare import Option
from dbbstation.tasks.diagnose import diagnose as task

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.diagnosis.effects import CauseEffect, WorkspaceError
    from dbbstation.diagnosis.findings import Curve, SourceFinding
    from dbbstation.results.diagnosis import DiagnosisFigures, DiagnosisResult


MOST_CAUSES = 4
"""Greatest number of causes whose circles are listed; the JSON has all."""


def print_effects(effects: Sequence[CauseEffect]) -> None:
    """Print causes and cures by contribution, and G as measured and without each cause."""
    if not effects:
        echo("\nno cause contributes to these circles")
        return
    echo(
        f"\nwhat each cause contributes [µm], {EXPANDED}; G up to 30 undulations per revolution, means over the circles"
    )
    rows = [
        [
            rank,
            one.cause,
            one.verdict or "-",
            *_pair(one.g_um, one.g_u_um),
            *_pair(one.centre_um, one.centre_u_um),
            *_pair(one.workspace_um, one.workspace_u_um),
            f"{one.measured_g_um:.1f}",
            f"{one.cured_g_um:.1f}",
        ]
        for rank, one in enumerate(effects, start=1)
    ]
    print_table(", cause, verdict, G, U, centres, U, workspace, U, G measured, without it", rows)
    echo("contributions of opposing causes need not add up to the measured value")
    for rank, one in enumerate(effects, start=1):
        echo(f"{rank}. {one.cause}: {one.cure}")
    shown = effects[:MOST_CAUSES]
    echo("\ncircles as they would be if one cause were cured: G [µm]")
    circles = [
        [
            *run.key,
            f"{run.measured_g_um:.1f}",
            *(f"{one.runs[k].cured_g_um:.1f}" for one in shown),
        ]
        for k, run in enumerate(effects[0].runs)
    ]
    print_table(["test", "dir", "n", "measured", *(f"without {one.cause}" for one in shown)], circles)


def _pair(value: float | None, u: float | None) -> tuple[str, str]:
    if value is None:
        return "-", "-"
    return with_uncertainty(value, expanded_uncertainty(u, COVERAGE_FACTOR))


EFFECTS = "Rank causes by their contribution to the circles, with cures and the circles without each cause."


def show(result: DiagnosisResult, *, effects: Annotated[bool, Option(EFFECTS)] = False) -> None:
    """Print the findings, and with `effects` the contribution of each cause."""
    _print(result)
    if effects:
        print_effects(result.effects)


def _write(result: DiagnosisResult, path: Path, *, force: bool) -> None:
    save(result, path, force=force)
    for warning in model_warnings(result.model):
        say(f"note: {warning}")


UNPREDICTABLE_UM = 1000.0
"""Error above which a prediction is printed as impossible [µm]."""


def _print(result: DiagnosisFigures) -> None:
    if result.held_out_worse:
        echo("Held-out tests are predicted worse than by the kinematic calibration alone.\n")
    echo("\n".join((*result.sentences(), "")))
    echo(f"{mismatch_sentence(result)}\n")
    echo_each(map(outlier_sentence, result.outliers))
    _print_sources(result.sources)
    if result.cancelling:
        echo(f"\n{cancelling_text(result.cancelling)}")
    if result.locations:
        echo("\nlargest misfit of the kinematic calibration:")
        print_locations(result.locations)
    _print_gain(result)
    if result.workspace:
        _print_workspace(result.workspace)
    if result.parameter_shift:
        echo("bias of the kinematic calibration, largest parameters:")
        for shift in result.parameter_shift[:4]:
            echo(f"  {shift.parameter}: {shift.shift_um:+.0f} µm")
    echo(result.unexplained.text)
    if result.unexplained.curve:
        _print_curve(result.unexplained.curve)
    echo_each(ending_sentences(result))


def _print_workspace(elsewhere: WorkspaceError) -> None:
    shift = ", ".join(f"{axis} {um:+.1f}" for axis, um in zip("XYZ", elsewhere.common_shift_um, strict=True))
    for which, error, u, more in (
        ("as a whole", elsewhere.error_with_shift_rms_um, elsewhere.uncertainty_with_shift_rms_um, ""),
        (
            "about a common shift",
            elsewhere.error_rms_um,
            elsewhere.uncertainty_rms_um,
            f", {elsewhere.error_greatest_um:.1f} µm at most",
        ),
    ):
        known = "not known" if u is None else f"{u:.1f} µm rms"
        echo(
            f"over the workspace, kinematic calibration less joint model, {which}: {error:.1f} µm rms{more}; u of the joint "
            f"model {known}"
        )
    echo(f"  the common shift is {shift} µm; a zero that is set on the part removes it")


MOST_POINTS = 12
"""Greatest number of printed points of a curve; a wave has more, so its size and period are printed."""


def _print_curve(curve: Curve) -> None:
    points = curve.points
    echo(
        f"an error of unknown cause moves the readings by {curve.readings_um:.2f} µm rms, and kinematic parameters cannot imitate {curve.unconcealed_um:.2f} µm rms of this:"
    )
    if curve.period_mm is not None:
        echo(
            f"  a wave of {curve.period_mm:.2f} mm, from {points[0].at:.0f} to {points[-1].at:.0f} mm, up to "
            f"{max(abs(point.value_um) for point in points):.2f} µm"
        )
    elif curve.form:
        echo(f"  {curve.form}")
    step = -(-len(points) // MOST_POINTS)
    rows = [[f"{p.at:.6g}", f"{p.value_um:+.2f}", "±", f"{p.uncertainty_um:.2f}"] for p in points[::step]]
    print_table([f"{curve.variable} / {curve.unit}", "error / µm", "", "u / µm"], rows)
    if curve.convention:
        echo(f"  ({curve.convention})")


def _print_gain(result: DiagnosisFigures) -> None:
    residual, held_out = result.residual_rms_um, result.held_out_rms_um
    echo(f"\nresidual within mountings {residual.before:.2f} -> {residual.after:.2f} µm rms")
    normalised = result.held_out_normalised
    if result.held_out == "not-tested" and any(source.verdict == "identified" for source in result.sources):
        echo("no tests were held out: predictions of the identified causes were not tested")
    if max(held_out.before, held_out.after) > UNPREDICTABLE_UM:
        echo("held-out tests cannot be predicted: the other tests are too few to identify the machine")
    else:
        echo(
            f"error of predicting held-out tests {held_out.before:.2f} -> {held_out.after:.2f} µm rms; over its "
            f"stated uncertainty {normalised.before:.2f} -> {normalised.after:.2f}"
        )


def _print_sources(sources: Sequence[SourceFinding]) -> None:
    rows = []
    for source in sources:
        shares = (source.concealed, source.stability)
        hidden, again = (None if share is None else f"{100 * share:.0f} %" for share in shares)
        gain = None if source.gain is None else round(source.gain)
        alike = ", ".join(source.ambiguous_with or source.equivalent[1:])
        rows.append([source.name, source.verdict, probability_text(source.probability), gain, hidden, again, alike])
    titles = (
        "cause, verdict, probability, log Bayes factor, concealed (R²), selection frequency, not distinguished from"
    )
    print_table(titles, rows)
    named = [source for source in sources if source.verdict in SAID]
    if named:
        echo("\nvalue ± u (one standard uncertainty)")
        for source in named:
            echo()
            for name, number in source.parameters.items():
                echo(f"{source.name}: {name} {number.in_words}")
            echo(f"  {source.text}")


diagnose = command(
    task,
    show,
    CommandOutput("out", "MODEL.yaml", _write, said="joint model written to {path}"),
    figure(said="figure written to {path}"),
    more=lambda: {"until_interrupted": True},
)
