"""Figures of circles that have an uncertainty."""

from __future__ import annotations

from enum import StrEnum


class BudgetQuantity(StrEnum):
    """Figures with a budget."""

    G = "G"
    G_LS = "G(LS)"
    F_MAX = "Fmax"
    F_MIN = "Fmin"
    RADIUS = "radius"
    MEAN_RADIAL = "mean radial error"
    X = "X"
    Y = "Y"
    G_BOTH = "G(b)"
    G_BOTH_LS = "G(b)(LS)"
    D = "D"
    H = "H"


ABSOLUTE = frozenset(
    {BudgetQuantity.F_MAX, BudgetQuantity.F_MIN, BudgetQuantity.RADIUS, BudgetQuantity.MEAN_RADIAL, BudgetQuantity.D}
)
"""Figures that depend on the bar's absolute length."""

FIRST = 2
"""First undulation of form: one per revolution is the centre."""
