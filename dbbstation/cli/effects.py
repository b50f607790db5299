"""Print findings: values with uncertainty, names, shown verdicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import echo, echo_each
from dbbstation.errors import OutputError
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.diagnosis.drive.findings import ForceLocation
    from dbbstation.diagnosis.findings import Location
    from dbbstation.inference.alternatives import Cancelling
    from dbbstation.inference.levels import Gains, Levels
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.results.mismatch import MismatchResult
    from dbbstation.results.simulator import PortTerm, SimulatorResult

SURELY_FOUND = ("identified", "happened", "does-not-predict")
"""Verdicts of effects that the recording proves."""

SAID = frozenset({*SURELY_FOUND, "ambiguous"})
"""Verdicts of causes whose values are printed."""

LIKELY = 0.5
"""Least probability of an uncertain effect that is printed; the JSON has all."""

MOST_NAMES = 6
"""Greatest number of names that are printed in a row."""


def parts_with_gain(gains: Gains | None, *, acts: str = "always") -> str:
    """Return the number of held-out parts with gain as text; empty if other parts cannot confirm the effect."""
    return gains.counted if gains is not None and acts == "always" else ""


def probability_text(probability: float | None) -> str:
    """Return a cause's probability as text; empty if it has none."""
    surest = 0.999
    if probability is None:
        return ""
    return f"> {surest}" if probability > surest else f"{probability:.3f}"


def print_locations(locations: Sequence[Location | ForceLocation]) -> None:
    """Print where the largest misfits are."""
    for location in locations[:5]:
        echo(f"  {location.text} ({100 * location.share:.0f} % of it)")


def cancelling_text(cancelling: Cancelling) -> str:
    """Return the cancelling effects as a sentence."""
    parts = ", ".join(f"{name} {rms:.2g}" for name, rms in cancelling.rms.items())
    return f"Effects cancel each other: {parts}, together {cancelling.rms_of_sum:.2g} {cancelling.unit} rms."


def print_finding(finding: CauseFinding | PortTerm, most_values: int, about: str = "") -> None:
    """Print an effect with its values, unless there are more than `most_values`, and its text."""
    echo(f"\n{finding.name}{about}")
    values = ", ".join(f"{name} {value.in_words}" for name, value in finding.values.items())
    if values and len(finding.values) <= most_values:
        echo(f"  {values}")
    if finding.text:
        echo(f"  {finding.text}")


def print_left(result: MismatchResult | SimulatorResult, beyond: str = "") -> None:
    """Print the residual beyond noise, absent effects, and the next measurements."""
    left, text = result.left, "Nothing is left beyond noise."
    if not left.is_noise:
        where = f", {left.worst.where}" if left.worst.where else ""
        text = f"Something is left beyond noise: {left.worst.name}{where}, {left.worst.rms:.2g} {result.unit}."
    echo(f"\n{text}{beyond}")
    for verdict in ("not-testable", "ruled-out"):
        names = [f.name for f in result.findings if f.verdict == verdict]
        if names:
            echo(f"{verdict}: {listed(names, MOST_NAMES)}")
    if result.next:
        echo("\nmeasure next:")
        echo_each(f"  {step.text}" for step in result.next)


def not_written(out: Path, levels: Levels) -> OutputError:
    """Refuse to write a correction that is worse than none."""
    from dbbstation.results.levels_text import no_correction

    return OutputError(f"not written. {no_correction(levels)}", where=str(out), remedy=MEND)


MEND = "free or state the parameters that hide the difference, or record more runs"
