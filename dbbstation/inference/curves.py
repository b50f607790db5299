"""Further forms of curves: splines, stretches of rows, and products of two variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline

from dbbstation.inference.forms import Form

if TYPE_CHECKING:
    from numpy.typing import NDArray

CUBIC = 3


@dataclass(frozen=True, eq=False)
class Spline(Form):
    """Any smooth curve: a cubic spline of so many functions over a range; outside it goes on as at its end.

    The functions add up to one [de Boor, A Practical Guide to Splines, rev. ed., ch. IX, eq. 36].
    """

    low: float
    high: float
    functions: int = 7

    @property
    def count(self) -> int:
        """One amplitude per function."""
        return self.functions

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """B-splines at the values, shape (..., p)."""
        inner = np.linspace(0.0, 1.0, self.functions - CUBIC + 1)
        knots = np.concatenate([np.zeros(CUBIC), inner, np.ones(CUBIC)])
        share = np.clip((np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low), 0.0, 1.0)
        flat = BSpline.design_matrix(share.ravel(), knots, CUBIC).toarray()
        return np.asarray(flat.reshape(*share.shape, self.functions), dtype=np.float64)

    def points(self, low: float, high: float) -> NDArray[np.float64]:
        """Three for each function."""
        return np.linspace(low, high, 3 * self.functions)


@dataclass(frozen=True, eq=False)
class Power(Form):
    """A power of the variable, from -1 to 1 over its range (odd) or 0 to 1 (even)."""

    low: float
    high: float
    power: int = 1

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The power of the scaled variable."""
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return (((values - middle) / half) ** self.power)[..., None]

    def points(self, low: float, high: float) -> NDArray[np.float64]:
        """Enough to see its bend."""
        return np.linspace(low, high, 3 if self.power == 1 else 13)


@dataclass(frozen=True, eq=False)
class Stretches(Form):
    """One value over each of several stretches of rows, nothing elsewhere; the variable is the number of the row."""

    first: tuple[int, ...]
    last: tuple[int, ...]

    @property
    def count(self) -> int:
        """One height per stretch."""
        return len(self.first)

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """One from the first row of each stretch to its last, shape (n, p)."""
        inside = (values[..., None] >= np.array(self.first)) & (values[..., None] <= np.array(self.last))
        return inside.astype(np.float64)

    def points(self, low: float, high: float) -> NDArray[np.float64]:
        """Both sides of every edge."""
        edges = np.array([[a - 1, a, b, b + 1] for a, b in zip(self.first, self.last, strict=True)]).ravel()
        return np.unique(np.clip(np.concatenate([[low], edges, [high]]), low, high).astype(np.float64))
