"""Further forms of curves: splines, stretches of rows, and products of two variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline

from dbbstation.inference.forms import Form

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

CUBIC = 3


@dataclass(frozen=True, eq=False)
class Spline(Form):
    """Any smooth curve: a cubic spline of so many functions over a range; outside it goes on as at its end.

    The functions add up to one [de Boor, A Practical Guide to Splines, rev. ed., ch. IX, eq. 36]. Without the last of them (`falls`) a
    curve falls to zero at the upper end.
    """

    low: float
    high: float
    functions: int = 7
    falls: bool = False

    @property
    def count(self) -> int:
        """One amplitude per function."""
        return self.functions - self.falls

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """B-splines at the values, shape (..., p)."""
        inner = np.linspace(0.0, 1.0, self.functions - CUBIC + 1)
        knots = np.concatenate([np.zeros(CUBIC), inner, np.ones(CUBIC)])
        share = np.clip((np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low), 0.0, 1.0)
        flat = BSpline.design_matrix(share.ravel(), knots, CUBIC).toarray()
        return np.asarray(flat.reshape(*share.shape, self.functions)[..., : self.count], dtype=np.float64)

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
class Clock:
    """When rows were, and what they show of something that begins at once.

    Attributes:
        rows: of each row, its time in rows from one to the next, rising, shape (n,); rows that were left out count too.
        response: what is seen of a step from zero to one, by rows since it, 0 long before and 1 long after.
        reach: rows before and after it beyond which the response is the same for all that follow.
    """

    rows: NDArray[np.float64]
    response: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    reach: float

    @classmethod
    def plain(cls, count: int) -> Clock:
        """Rows without a gap that show a step at once."""
        return cls(np.arange(count, dtype=np.float64), lambda since: (since >= 0.0).astype(np.float64), 0.0)


@dataclass(frozen=True, eq=False)
class Stretches(Form):
    """One value over each of several stretches of time, nothing elsewhere; the variable is the time in rows of a clock.

    Attributes:
        last: its end; infinite where it does not end.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    response: Callable[[NDArray[np.float64]], NDArray[np.float64]]

    @property
    def count(self) -> int:
        """One height per stretch."""
        return len(self.first)

    def columns(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is seen of one in each stretch, shape (n, p)."""
        begun, ended = (self.response(values[..., None] - np.array(edges)) for edges in (self.first, self.last))
        return np.asarray(begun - ended, dtype=np.float64)

    def points(self, low: float, high: float) -> NDArray[np.float64]:
        """Both sides of every edge."""
        edges = np.array([[a - 0.5, a + 0.5, b - 0.5, b + 0.5] for a, b in zip(self.first, self.last, strict=True)])
        return np.unique(np.clip(np.concatenate([[low], edges.ravel(), [high]]), low, high))
