"""Curves: splines, powers, and stretches of rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline

from dbbstation.inference.forms import Form

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Floats

CUBIC = 3


@dataclass(frozen=True, eq=False)
class Spline(Form):
    """A smooth curve: cubic B-splines over a range, constant outside.

    The splines sum to one [de Boor, A Practical Guide to Splines, rev. ed., ch. IX, eq. 36]. With `falls` the last is
    omitted, so the curve falls to zero.
    """

    low: float
    high: float
    functions: int = 7
    falls: bool = False

    @property
    def count(self) -> int:
        return self.functions - self.falls

    def columns(self, values: Floats) -> Floats:
        """Return B-splines at values, shape (..., p)."""
        inner = np.linspace(0.0, 1.0, self.functions - CUBIC + 1)
        knots = np.concatenate([np.zeros(CUBIC), inner, np.ones(CUBIC)])
        share = np.clip((np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low), 0.0, 1.0)
        flat = BSpline.design_matrix(share.ravel(), knots, CUBIC).toarray()
        return flat.reshape(*share.shape, self.functions)[..., : self.count]


@dataclass(frozen=True, eq=False)
class Power(Form):
    """A power of the variable scaled to -1..1 (odd) or 0..1 (even)."""

    low: float
    high: float

    def columns(self, values: Floats) -> Floats:
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        return ((values - middle) / half)[..., None]


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of rows, and the response of rows to a step.

    Attributes:
        rows: time in row intervals, ascending, shape (n,); omitted rows count.
        response: response to a unit step over rows since the step, from 0 to 1.
        reach: rows until the response is constant.
    """

    rows: Floats
    response: Callable[[Floats], Floats]
    reach: float

    @classmethod
    def plain(cls, count: int) -> Clock:
        """Return the clock of gapless rows with immediate response."""
        return cls(np.arange(count, dtype=np.float64), lambda since: (since >= 0.0).astype(np.float64), 0.0)


@dataclass(frozen=True, eq=False)
class Stretches(Form):
    """One value per stretch of time, zero outside; the variable is a clock's rows.

    Attributes:
        last: infinite if endless.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    response: Callable[[Floats], Floats]

    @property
    def count(self) -> int:
        return len(self.first)

    def columns(self, values: Floats) -> Floats:
        """Return each stretch's curve at values, shape (n, p)."""
        begun, ended = (self.response(values[..., None] - np.array(edges)) for edges in (self.first, self.last))
        return begun - ended
