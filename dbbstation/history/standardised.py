"""Values of one quantity, each held against those before it: independent standard normal numbers where nothing changes.

The level is estimated from the values before, and so is their scatter beyond the stated uncertainties. Both estimates are
uncertain, and are taken for that: a residual from the level before is independent of all residuals before it [Brown, Durbin and
Evans 1975, J. R. Stat. Soc. B 37, 149], and over their scatter it follows Student's t, which its probability turns into a
standard normal number [Hawkins 1987, The Statistician 36, 299].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri, stdtr

if TYPE_CHECKING:
    from numpy.typing import NDArray

BASELINE = 10
"""Values from which level and scatter are known well enough to watch the next ones: the level to u / 3, the scatter to 24 %.
`dbbstation study history` shows what 5 and 20 would bring."""

_SMALLEST = 1e-300
"""Probabilities below it are taken for it: the number that belongs to it is 37, far beyond every limit."""


@dataclass(frozen=True, eq=False)
class Standardised:
    """Values held against those before them; arrays have shape (n,).

    Attributes:
        z: standard normal where nothing changes; NaN in the baseline.
        level: weighted mean of the values before; NaN for the first.
        u_level: its standard uncertainty by the stated ones alone; NaN for the first.
        scatter: standard deviation of the values before, in stated uncertainties; NaN for the first two.
    """

    z: NDArray[np.float64]
    level: NDArray[np.float64]
    u_level: NDArray[np.float64]
    scatter: NDArray[np.float64]


def standardised(values: NDArray[np.float64], u: NDArray[np.float64], baseline: int = BASELINE) -> Standardised:
    """Hold each value against those before it, weighted by their stated uncertainties.

    The scatter is a factor common to all uncertainties. It may be below one: what is stated for every session may hold parts
    that are the same in all of them, such as the calibrated length of the bar.

    Args:
        values: in time order, shape (n,).
        u: standard uncertainty of each, positive, in the same unit, shape (n,).
        baseline: values that are not held against anything, at least 3.
    """
    count = len(values)
    level, u_level, scatter = (np.full(count, np.nan) for _ in range(3))
    z = np.full(count, np.nan)
    if count:
        about = values - values[0]  # sums of small numbers lose no digits
        weight = 1.0 / u**2
        sums = np.cumsum(weight)[:-1]
        level[1:] = values[0] + np.cumsum(weight * about)[:-1] / sums
        u_level[1:] = 1.0 / np.sqrt(sums)
    residual = (values[1:] - level[1:]) / np.hypot(u[1:], u_level[1:])
    freedom = np.arange(1, count - 1)
    scatter[2:] = np.sqrt(np.cumsum(residual**2)[:-1] / freedom)
    watched = np.arange(count) >= baseline
    off = np.zeros(count)
    off[1:] = residual
    # Values that are all alike have no scatter: the smallest departure is then beyond it, and none is none.
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(off[watched] == 0.0, 0.0, off[watched] / scatter[watched])
    beyond = stdtr(np.arange(count)[watched] - 1.0, -np.abs(ratio))
    z[watched] = -np.sign(ratio) * ndtri(np.maximum(beyond, _SMALLEST))
    return Standardised(z, level, u_level, scatter)
