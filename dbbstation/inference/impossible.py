"""Values that cannot be: what takes up energy, or has a size, cannot be negative beyond its uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.inference.channel import Law

NEGATIVE_SIGMA = 3.0
"""Standard deviations below zero from which a value that cannot be negative is impossible: one in 700 by chance."""


def impossible(law: Law, values: NDArray[np.float64], variances: NDArray[np.float64]) -> str:
    """Why amplitudes of a law cannot be: one is negative beyond its uncertainty though it cannot be; empty where they can.

    Args:
        values: shape (p,).
        variances: of these, shape (p,).
    """
    for k, positive in enumerate(law.positive):
        value = float(values[k])
        sigma = float(np.hypot(np.sqrt(variances[k]), law.form_uncertainty * value))
        if positive and (why := impossibly_negative(law.parameters[k], value, sigma, law.units[k])):
            return why
    return ""


def impossibly_negative(name: str, value: float, sigma: float, unit: str) -> str:
    """Why a value that cannot be negative is none that can be: it is so beyond its uncertainty; empty where it is not."""
    if value >= -NEGATIVE_SIGMA * sigma:
        return ""
    return (
        f"It would have to be negative, {name} {value:.3g} ± {sigma:.2g} {unit}, which it "
        "cannot be: something else that does the opposite is at work."
    )
