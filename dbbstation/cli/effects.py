"""Print findings: values with uncertainty, names, shown verdicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.verdict import Gains

SURELY_FOUND = ("identified", "happened", "does-not-predict")
"""Verdicts of effects that the recording proves."""

LIKELY = 0.5
"""Least probability of an uncertain effect that is printed; the JSON has all."""

MOST_NAMES = 6
"""Greatest number of names that are printed in a row."""


def first_names(names: Sequence[str]) -> str:
    """Return a list of names as text: the first ones, and the count of the others."""
    shown = ", ".join(names[:MOST_NAMES])
    return shown if len(names) <= MOST_NAMES else f"{shown} and {len(names) - MOST_NAMES} more"


def parts_with_gain(gains: Gains | None, *, acts: str = "always") -> str:
    """Return the count of held-out parts with gain as text; empty if other parts cannot confirm it."""
    return gains.counted if gains is not None and acts == "always" else ""


def cancelling_text(cancelling: Cancelling) -> str:
    """Return the cancelling effects as a sentence."""
    parts = ", ".join(f"{name} {rms:.2g}" for name, rms in cancelling.rms.items())
    return f"Effects cancel each other: {parts}, together {cancelling.rms_of_sum:.2g} {cancelling.unit} rms."


def residual_text(left: LeftOver, unit: str) -> str:
    """Return the residual beyond noise as a sentence."""
    if left.is_noise:
        return "Nothing is left beyond noise."
    where = f", {left.worst.where}" if left.worst.where else ""
    return f"Something is left beyond noise: {left.worst.name}{where}, {left.worst.rms:.2g} {unit}."


def not_written(out: Path, levels: Levels) -> OutputError:
    """Refuse to write a correction that is worse than none."""
    from dbbstation.results.levels_text import no_correction

    return OutputError(f"not written. {no_correction(levels)}", where=str(out), remedy=MEND)


MEND = "free or state the parameters that hide the difference, or record more runs"
