"""Piecewise linear curves of six struts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

MM_PER_UM = 1e-3

TOLERANCE_UM = 10.0
"""Prior standard deviation of a value in every fit [µm]; it keeps points without nearby readings at zero."""

PLAUSIBLE_UM = 2.0 * TOLERANCE_UM
"""Usual size [µm], so far above the tolerance that no fit counts a point bounded by the tolerance as lost."""


def values_at(points: Floats, unit: str) -> tuple[Parameter, ...]:
    """Return one parameter per strut and point, ordered by strut."""
    return tuple(
        Parameter(
            f"strut_{i + 1}_at_{number}_um",
            "µm",
            PLAUSIBLE_UM,
            f"strut {i + 1} actual minus driven length at {place:g} {unit}, cause unknown",
            tolerance=TOLERANCE_UM,
            strut=i + 1,
        )
        for i in range(STRUTS)
        for number, place in enumerate(points, start=1)
    )


def piecewise_linear(points: Floats, values: Floats) -> Effect:
    """Return the derivative by the values at the points, constant beyond the ends.

    Args:
        points: evenly spaced arguments of the curve, shape (p,).
        values: arguments of the samples, in the points' unit, shape (n, 6).
    """
    count = len(points)
    place = np.clip((values - points[0]) / (points[1] - points[0]), 0.0, count - 1.0)
    near = np.maximum(0.0, 1.0 - np.abs(place[:, :, None] - np.arange(count)))
    own = near[:, :, None, :] * np.eye(STRUTS)[:, :, None]
    return Effect(strut_mm=MM_PER_UM * own.reshape(len(values), STRUTS, STRUTS * count))


def texts(variable: str, equation: str) -> Texts:
    """Return texts for an error whose variable is known and whose cause is unknown."""
    return Texts(
        what=f"An error of the struts that follows their {variable}; its cause is unknown.",
        shows=f"What a diagnosis leaves without a name repeats at the same {variable}, in every test and direction.",
        confirm=f"Record the tests again: the curve over {variable} comes back. Look at the strut that it names.",
        cure="Find the cause. Until then a model that keeps the curve compensates it where it was measured, and nowhere "
        "else.",
        equation=equation,
        origin="no physics: a curve through what was measured",
    )
