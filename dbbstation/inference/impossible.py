"""Detect impossible values, such as significantly negative ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.facts.value import Value
    from dbbstation.inference.channel import Law

NEGATIVE_SIGMA = 3.0
"""Standard deviations below zero at which a non-negative parameter is impossible: one in 700 by chance."""


def impossible(law: Law, values: Floats, variances: Floats, least: float = NEGATIVE_SIGMA) -> str:
    """Return why amplitudes are impossible, else an empty text; arguments as of `impossibly_negative`."""
    for k, positive in enumerate(law.positive):
        value = float(values[k])
        sigma = float(np.hypot(np.sqrt(variances[k]), law.form_uncertainty * value))
        if positive and (why := impossibly_negative(law.parameters[k], value, sigma, law.units[k], least)):
            return why
    return ""


BEYOND = 5.0
"""Largest rms of an effect over a variable, relative to the whole difference; a larger effect would mostly cancel with
others."""


def beyond_reach(law: Law, rms: float) -> str:
    """Return why an effect of a pattern is too large, else an empty text."""
    if law.family is None or law.reach is None or rms <= BEYOND * law.reach:
        return ""
    return f"It would have to be {rms / law.reach:.2g} times the difference itself, and cancel with others."


def impossible_beside(law: Law, values: Mapping[str, Value], every: Mapping[str, float]) -> str:
    """Return why a law's values contradict the values of other laws, else an empty text."""
    if law.possible(every):
        return ""
    shown = ", ".join(f"{name} {value.value:.3g} {value.unit}" for name, value in values.items())
    return f"It would have to be {shown}, which it cannot be beside the rest: something else is at work."


def impossibly_negative(name: str, value: float, sigma: float, unit: str, least: float = NEGATIVE_SIGMA) -> str:
    """Return why a value below zero by so many standard deviations is impossible, else an empty text."""
    if value >= -least * sigma:
        return ""
    return (
        f"It would have to be negative, {name} {value:.3g} ± {sigma:.2g} {unit}, which it "
        "cannot be: something else that does the opposite is at work."
    )
