"""`dbbstation identify`: mass and friction of a strut drive, and physics beyond them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command, figure
from dbbstation.cli.effects import SAID, cancelling_text, print_locations, probability_text
from dbbstation.cli.output import echo, echo_each, print_table
from dbbstation.tasks.drive import identify as task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.drive.findings import DriveFinding
    from dbbstation.results.drive import DriveResult


def show(result: DriveResult) -> None:
    """Print the identified physics."""
    if (held := result.held_out_rms_n) and held.worse:
        echo(
            f"Everything found predicts held-out parts worse than mass and friction alone: {held.corrected:.3g} N rms against "
            f"{held.reference:.3g} N."
        )
    echo("\n".join((*result.sentences(), "")))
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
        known = number.in_words if number.identifiable else "not identifiable from this recording"
        echo(f"  {name}: {known}")
    for side, values in result.friction.items():
        echo(f"  friction {side}: " + ", ".join(f"{name} {n.in_words}" for name, n in values.items()))
    held_back = result.held_back
    first, last = held_back.t_s
    echo(f"\nrelative force error on {first:.2f} to {last:.2f} s, fitted without this part:")
    before = float("inf")
    for step in held_back.steps:
        name = f"+ {step.added}" if step.added else "mass and viscous friction"
        error = step.relative_force_error
        worse = "  worse than without it: it does not carry over to this stretch" if error > before else ""
        echo(f"  {name:<26} {100 * error:6.2f} %{worse}")
        before = error
    if left_out := held_back.not_in_model:
        echo(f"  not in the model, since these recordings do not decide on it: {', '.join(left_out)}")
    if result.locations:
        echo("\nwhere the misfit of mass and viscous friction is largest:")
        print_locations(result.locations)
    _print_rest(result)


def _print_rest(result: DriveResult) -> None:
    echo("\n" + result.unexplained.text)
    if result.unexplained.significant:
        for effect in result.unexplained.effects[:3]:
            echo(
                f"  {effect.text}: {effect.rms_n:.2g} N rms, from {effect.low:.4g} to {effect.high:.4g} {effect.unit} "
                f"(probability {probability_text(effect.probability)})"
            )
        echo(f"It is {result.unexplained.rms_n:.2g} N rms; largest:")
        print_locations(result.unexplained.locations[:3])
    if result.cancelling:
        echo(cancelling_text(result.cancelling))
    echo_each(result.cannot_tell)
    signals = result.signals
    echo(f"band up to {signals.cutoff_hz:.3g} Hz, {signals.samples_compared} samples compared")


def _print_sources(sources: Sequence[DriveFinding]) -> None:
    rows = [
        [
            s.name,
            s.verdict,
            probability_text(s.probability),
            f"{s.gain:.0f}",
            f"{100 * s.concealed:.0f} %",
            ", ".join(s.ambiguous_with),
        ]
        for s in sources
    ]
    print_table("cause, verdict, probability, log Bayes factor, concealed (R²), not distinguished from", rows)
    for source in sources:
        if source.verdict in SAID:
            echo()
            _print_parts(source)
            echo(f"  {source.text}")


def _print_parts(source: DriveFinding) -> None:
    if source.parameters and len(source.parts) <= 1:
        for name, number in source.parameters.items():
            echo(f"{source.name}: {name} {number.in_words}")
        return
    for part in source.parts:
        when = f"from {part.t_s[0]:.3f} to {part.t_s[1]:.3f} s, " if part.t_s else ""
        numbers = ", ".join(f"{name} {number.in_words}" for name, number in part.parameters.items())
        echo(f"{source.name}: {when}{numbers}")


identify = command(
    task,
    show,
    CommandOutput("table", table=True, field="compared"),
    figure(),
)
