"""Transform one quantity's values to independent standard normal numbers by comparison with earlier values.

Earlier values give the level and, later, the scatter. Recursive residuals are independent [Brown, Durbin and Evans
1975, J. R. Stat. Soc. B 37, 149]. Divided by their scatter they follow Student's t, whose probability gives a standard
normal number [Hawkins 1987, The Statistician 36, 299]. Early residuals are divided by the stated uncertainty instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, ndtri, stdtr

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers

BASELINE = 10
"""Number of values whose level and scatter replace the stated uncertainty: the level is then known to u / 3, the
scatter to 24 %. `python -m studies history` compares 5 and 20."""

CONTRADICTS = 0.05
"""Probability below which a scatter contradicts the stated uncertainties. One sound quantity in twenty is then compared
with a slightly larger scatter for a few sessions."""

_SMALLEST = 1e-300
"""Lower bound of probabilities: its normal number is 37, far beyond every limit."""


@dataclass(frozen=True)
class ScatterRatio:
    """Scatter of values about their level, in stated uncertainties.

    Attributes:
        freedom: degrees of freedom, one fewer than values for each level.
    """

    freedom: int = 0
    square: float = 0.0

    @property
    def size(self) -> float:
        """Return the standard deviation; NaN if unknown."""
        return sqrt(self.square / self.freedom) if self.freedom else nan

    @property
    def more_than_stated(self) -> bool:
        """Return whether the scatter contradicts the stated uncertainties."""
        return self.freedom > 0 and bool(chdtrc(self.freedom, self.square) < CONTRADICTS)

    def with_residuals(self, residual: Floats) -> ScatterRatio:
        """Return the ratio updated by further recursive residuals, in standard uncertainties."""
        return ScatterRatio(self.freedom + len(residual), self.square + float(residual @ residual))


@dataclass(frozen=True, eq=False)
class Standardised:
    """Values compared with earlier values; arrays have shape (n,).

    Attributes:
        z: standard normal if nothing changed; NaN for the first.
        by_stated: whether z uses stated uncertainties alone.
        u_level: standard uncertainty of the level, from stated uncertainties alone; NaN for the first.
        scatter: standard deviation of earlier values, in stated uncertainties; NaN if not known.
    """

    z: Floats
    by_stated: Flags
    residual: Floats
    level: Floats
    u_level: Floats
    scatter: Floats


def standardised(
    values: Floats,
    u: Floats,
    baseline: int = BASELINE,
    before: ScatterRatio = ScatterRatio(),
    hindsight: ScatterRatio | None = None,
) -> Standardised:
    """Compare each value with earlier values, weighted by stated uncertainties.

    The scatter is a common factor of all uncertainties. It may be below one, since sessions share parts such as the bar's
    length.

    Args:
        u: standard uncertainty of each, positive, in the same unit, shape (n,).
        baseline: number of values from which scatter replaces stated uncertainty, at least 3.
        before: scatter about earlier levels.
        hindsight: scatter of the whole history, for early values; None: the stated uncertainties.
    """
    count = len(values)
    level, u_level, residual, z = (np.full(count, np.nan) for _ in range(4))
    if count:
        about = values - values[0]  # small numbers keep their digits in sums
        weight = 1.0 / u**2
        sums = np.cumsum(weight)[:-1]
        level[1:] = values[0] + np.cumsum(weight * about)[:-1] / sums
        u_level[1:] = 1.0 / np.sqrt(sums)
    residual[1:] = (values[1:] - level[1:]) / np.hypot(u[1:], u_level[1:])
    held = np.isfinite(residual)
    freedom = before.freedom + np.arange(count) - 1
    square = before.square + np.concatenate([np.zeros(min(count, 2)), np.cumsum(residual[1:-1] ** 2)])[:count]
    with np.errstate(divide="ignore", invalid="ignore"):
        scatter = np.where(held & (freedom > 0), np.sqrt(square / np.maximum(freedom, 1)), np.nan)
    known = held & (freedom >= baseline - 1)
    z[known] = _normal(residual[known], scatter[known], freedom[known])
    early = held & ~known
    z[early] = residual[early]
    if hindsight is not None and hindsight.freedom >= baseline - 1:
        of_all = np.full(int(early.sum()), hindsight.size)
        z[early] = _normal(residual[early], of_all, np.full(len(of_all), hindsight.freedom))
    elif hindsight is not None:  # Student's t with one or two degrees of freedom would detect no change
        z[early] = residual[early] / hindsight.size
    return Standardised(z, early & (hindsight is None), residual, level, u_level, scatter)


def _normal(residual: Floats, scatter: Floats, freedom: Integers) -> Floats:
    # Equal values have zero scatter: any departure is then infinite, and no departure is zero.
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(residual == 0.0, 0.0, residual / scatter)
    beyond = stdtr(freedom.astype(np.float64), -np.abs(ratio))
    return -np.sign(ratio) * ndtri(np.maximum(beyond, _SMALLEST))
