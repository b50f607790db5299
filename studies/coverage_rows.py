"""Rows of a coverage table: how often 95 % intervals hold the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri

if TYPE_CHECKING:
    from numpy.typing import NDArray

WITHIN = float(ndtri(0.975))
"""Standard uncertainties to each side of a 95 % interval."""

LEAST, MOST = 0.93, 0.97
"""Shares inside a 95 % interval that are wanted; more needs a reason beside it."""

CHANCE = float(ndtri(0.9995))
"""Standard errors by which a share may miss what is wanted by chance: once in two thousand rows."""


@dataclass(frozen=True)
class Row:
    """Coverage of one figure.

    Attributes:
        draws: machines or recordings.
        values: of all draws.
        inside: share within 1.96 u or U = 2 u; None if none is stated.
        error: standard error by draws; or None.
        u: median standard uncertainty, or None.
        reason: for more than 97 % inside; may be empty.
    """

    case: str
    figure: str
    draws: int
    values: int
    stated: float
    inside: float | None
    error: float | None
    u: float | None
    unit: str
    reason: str = ""

    @property
    def fault(self) -> str:
        """Return a fault beyond chance, or an empty text."""
        if self.inside is None or self.error is None:
            return ""
        if self.inside + CHANCE * self.error < LEAST:
            return f"{self.figure}, {self.case}: only {100 * self.inside:.1f} % inside"
        if self.inside - CHANCE * self.error > MOST and not self.reason:
            return f"{self.figure}, {self.case}: {100 * self.inside:.1f} % inside, and no reason beside it"
        return ""

    def plain(self) -> dict[str, Any]:
        """Return it as plain numbers."""
        return {
            "case": self.case,
            "figure": self.figure,
            "draws": self.draws,
            "values": self.values,
            "stated": self.stated,
            "inside": self.inside,
            "standard_error": self.error,
            "u": self.u,
            "unit": self.unit,
            "reason": self.reason or None,
        }


def row_of(
    case: str,
    figure: str,
    off: NDArray[np.float64],
    u: NDArray[np.float64],
    unit: str,
    reason: str = "",
    within: float = WITHIN,
) -> Row:
    """Return the row of one figure.

    Args:
        off: found less true, shape (draws, values of each).
        u: standard uncertainty, same shape, NaN for none.
        reason: for more than 97 % inside.
        within: half-width in u: 2 for a printed U; 1.96 for intervals reaching zero.
    """
    known = np.isfinite(u)
    inside = np.abs(off) < within * np.where(known, u, 0.0)
    draws, of_draw = len(off), known.sum(axis=1)
    stated = float(known.mean())
    if not known.any():
        return Row(case, figure, draws, 0, stated, None, None, None, unit, reason)
    share = float(inside.sum() / known.sum())
    # Values of one draw hang together: a draw counts as one [Cochran, Sampling Techniques, 1977, eq 2.45, a ratio estimate].
    # A share of all or none of them has no scatter to take; that of one value in so many draws bounds it.
    apart = inside.sum(axis=1) - share * of_draw
    error = float(np.sqrt(np.sum(apart**2) / max(draws - 1, 1) * draws) / known.sum())
    error = max(error, float(np.sqrt(LEAST * (1.0 - LEAST) / known.sum())))
    return Row(case, figure, draws, int(known.sum()), stated, share, error, float(np.nanmedian(u)), unit, reason)
