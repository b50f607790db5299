"""`dbbstation drive`: mass and friction of one strut drive, and what a model of these leaves out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.effects import cancelling_text
from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.number_types import Finite
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.drive.findings import DriveFinding, ForceLocation, HeldOutForce
    from dbbstation.facts.value import Value
    from dbbstation.results.drive import DriveResult


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RECORDING.csv...")
@click.option(
    "--force-per-ampere", type=Finite(), metavar="N/A", help="Force of the drive at 1 A, for motor_current_a."
)
@click.option("--sources", metavar="A,B,...", help="Causes to compare [default: all].")
@click.option(
    "--cutoff-hz",
    type=Finite(),
    metavar="HZ",
    help="Bandwidth in which force and model are compared [default: chosen from the recording].",
)
@click.option(
    "--no-held-out", is_flag=True, help="Skip the check on parts that causes were not chosen from: much faster."
)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write what was compared here, as CSV.")
@figure_option("Draw force and friction here")
@click.option("--force", is_flag=True, help="Overwrite these files.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def drive(
    recordings: tuple[Path, ...],
    *,
    force_per_ampere: float | None,
    sources: str | None,
    cutoff_hz: float | None,
    no_held_out: bool,
    out: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Identify one strut drive from position and force, and find the physics that mass and viscous friction leave out.

    The recording is a CSV file with the columns t_s, position_mm and force_n, or motor_current_a. Record strokes to and
    fro at several speeds. Several recordings of one drive are taken together. Verdicts: identified, happened, does-not-predict,
    ambiguous, not-testable, ruled-out.

    \b
    Examples:
      dbbstation drive strut3.csv
      dbbstation drive slow.csv fast.csv
      dbbstation drive strut3.csv --force-per-ampere 410 --figure strut3.svg
      dbbstation drive strut3.csv --sources coulomb-friction,friction-asymmetry --json
    """
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.files.provenance import refuse_existing_table, write_table
    from dbbstation.files.recordings.drive_csv import compared_csv
    from dbbstation.tasks.drive import STAGES
    from dbbstation.tasks.drive import drive as identified

    if out is not None:
        refuse_existing_table(out, force=force)
    if figure is not None:
        refuse_existing(figure, force=force)
    with stage_bar("identification", STAGES) as progress:
        result = identified(
            recordings,
            force_per_ampere=force_per_ampere,
            sources=[name.strip() for name in sources.split(",")] if sources else None,
            cutoff_hz=cutoff_hz,
            hold_out=not no_held_out,
            progress=progress,
            say=lambda text: say(f"note: {text}"),
        )
    if out is not None:
        write_table(out, compared_csv(result.table), provenance(), force=force)
        result = replace(result, compared=str(out))
    if figure is not None and result.drawing is not None:
        write_bytes(figure, result.drawing(format_of(figure)), force=force)
        result = replace(result, figure=str(figure))
    if as_json:
        print_result(result)
    else:
        _print(result)


def _print(result: DriveResult) -> None:
    _print_if_worse(result.held_out_rms_n)
    if result.mismatch:
        echo(
            f"Mass and viscous friction leave {result.misfit_rms_n:.3g} N rms beyond noise "
            f"(probability by chance {max(result.probability, 1e-99):.1g})."
        )
    else:
        echo(f"Mass and viscous friction are enough (probability {result.probability:.2g}).")
    echo()
    _print_sources(result.sources)
    echo("\nidentified:")
    for name, number in result.parameters.items():
        known = _number(number) if number.identifiable else "not identifiable from this recording"
        echo(f"  {name}: {known}")
    for side, values in result.friction.items():
        echo(f"  friction {side}: " + ", ".join(f"{name} {_number(n)}" for name, n in values.items()))
    held_back = result.held_back
    first, last = held_back.t_s
    echo(f"\nrelative force error on {first:.2f} to {last:.2f} s, fitted without it:")
    before = float("inf")
    for step in held_back.steps:
        name = f"+ {step.added}" if step.added else "mass and viscous friction"
        error = step.relative_force_error
        worse = "  worse than without it: it does not carry over to this stretch" if error > before else ""
        echo(f"  {name:<26} {100 * error:6.2f} %{worse}")
        before = error
    if left_out := held_back.not_in_model:
        echo(f"  not in the model, since nothing decides on it: {', '.join(left_out)}")
    if result.locations:
        echo("\nwhere the misfit of mass and viscous friction is largest:")
        _print_locations(result.locations)
    _print_rest(result)


def _print_rest(result: DriveResult) -> None:
    """Print unnamed, cancelling and undecided parts, and the band."""
    echo("\n" + result.unexplained.text)
    if result.unexplained.significant:
        for effect in result.unexplained.effects[:3]:
            echo(
                f"  {effect.text}: {effect.rms_n:.2g} N rms, from {effect.low:.4g} to {effect.high:.4g} {effect.unit} "
                f"(probability {_probability(effect.probability)})"
            )
        echo(f"It is {result.unexplained.rms_n:.2g} N rms; largest:")
        _print_locations(result.unexplained.locations[:3])
    if result.cancelling:
        echo(cancelling_text(result.cancelling))
    for sentence in result.cannot_tell:
        echo(sentence)
    signals = result.signals
    echo(f"band up to {signals.cutoff_hz:.3g} Hz, {signals.samples_compared} samples compared")


def _print_if_worse(held: HeldOutForce | None) -> None:
    if held and held.worse:
        echo(
            f"Everything found predicts held-out parts worse than mass and friction alone: {held.corrected:.3g} N rms against "
            f"{held.reference:.3g} N. Nothing is identified."
        )


def _print_locations(locations: Sequence[ForceLocation]) -> None:
    for location in locations[:5]:
        echo(f"  {location.text} ({100 * location.share:.0f} % of it)")


def _print_sources(sources: Sequence[DriveFinding]) -> None:
    from dbbstation.cli.output import print_table

    rows = [
        [
            s.name,
            s.verdict,
            _probability(s.probability),
            f"{s.gain:.0f}",
            f"{100 * s.concealed:.0f} %",
            ", ".join(s.ambiguous_with),
        ]
        for s in sources
    ]
    print_table(
        ["cause", "verdict", "probability", "log Bayes factor", "concealed (R²)", "not distinguished from"], rows
    )
    for source in sources:
        if source.verdict in {"identified", "happened", "does-not-predict", "ambiguous"}:
            echo()
            _print_parts(source)
            echo(f"  {source.text}")


def _print_parts(source: DriveFinding) -> None:
    """Print a cause's numbers, by wave or pulse."""
    if source.parameters and len(source.parts) <= 1:
        for name, number in source.parameters.items():
            echo(f"{source.name}: {name} {_number(number)}")
        return
    for part in source.parts:
        when = f"from {part.t_s[0]:.3f} to {part.t_s[1]:.3f} s, " if part.t_s else ""
        numbers = ", ".join(f"{name} {_number(number)}" for name, number in part.parameters.items())
        echo(f"{source.name}: {when}{numbers}")


def _probability(probability: float) -> str:
    return "> 0.999" if probability > 0.999 else f"{probability:.3f}"  # noqa: PLR2004 - three digits are shown


def _number(number: Value) -> str:
    if not number.is_known:
        return f"{number.value:#.4g} {number.unit}"
    return f"{number.value:#.4g} ± {number.uncertainty:.2g} {number.unit}"
