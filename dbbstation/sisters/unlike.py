"""Find machines that differ from like machines, at a stated rate of false alarms.

The values of like machines scatter normally about a mean, with added standard uncertainties. Weights and scatter follow
[Paule and Mandel 1982, J. Res. NBS 87, 377; DerSimonian and Kacker 2007, Contemp. Clin. Trials 28, 105]. The most
distant machine is removed repeatedly, up to a quarter, and tested against the remaining ones. The last significant test
gives the number of unlike machines [Rosner 1983, Technometrics 25, 165]. For one machine this is the test of Grubbs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri, stdtr, stdtrit

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers

FALSE_ALARMS = 0.01
"""Probability that a fleet of like machines shows any unlike value."""

FEWEST = 3
"""Least number of machines for a comparison: the others then have a scatter."""

MOST_UNLIKE = 4
"""At most one machine in this number may be unlike; more unlike machines are a separate kind."""

_STEPS = 100
"""Greatest number of Newton steps for the scatter; it converges from one side in about twelve."""

_SETTLED = 1e-12
"""Relative change of the variance below which the iteration has converged."""

_SMALLEST = 1e-300
"""Smallest probability: smaller ones are replaced by it. Its score is 37, far beyond every limit."""

_ROUNDED = 1e-12
"""Relative difference of values that is only rounding."""


@dataclass(frozen=True, eq=False)
class Sisters:
    """Comparison of machines with like machines, shape (q, n), NaN if unknown.

    Attributes:
        score: departure from like machines, standard normal for a like machine.
        scatter: scatter of like machines beyond uncertainties, in the quantity's unit.
        smallest_seen: departure that would count as unlike, in the quantity's unit.
    """

    unlike: Flags
    score: Floats
    middle: Floats
    scatter: Floats
    smallest_seen: Floats


def held_against_sisters(values: Floats, u: Floats, false_alarms: float = FALSE_ALARMS) -> Sisters:
    """Compare machines with like machines, from values and standard uncertainties, shape (q, n), NaN if unknown."""
    unlike = unlike_machines(values, u, false_alarms)
    return _scored(values, u, unlike, _share(values, false_alarms))


def unlike_machines(values: Floats, u: Floats, false_alarms: float = FALSE_ALARMS) -> Flags:
    """Return unlike machines, shape (q, n); arguments as of `held_against_sisters`."""
    known = np.isfinite(values)
    left = known.copy()
    variance = np.where(np.isfinite(u), u, 0.0) ** 2
    counts = known.sum(axis=1)
    most = np.where(counts >= FEWEST, np.maximum(counts // MOST_UNLIKE, 1), 0)
    rows = np.arange(len(values))
    removed_at = np.full(values.shape, 0)
    found = np.zeros(len(values), dtype=np.int64)
    share = _share(values, false_alarms)
    for step in range(1, int(most.max(initial=0)) + 1):
        going = step <= most
        middle, square = _middle(values, variance, left)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.abs(values - middle[:, None]) / np.sqrt(square[:, None] + variance)
        off = np.where(left, np.nan_to_num(off, nan=0.0, posinf=np.inf), -1.0)
        farthest = off.argmax(axis=1)
        others = left.copy()
        others[rows, farthest] = False
        probability = 2.0 * _departure(values, variance, others, farthest).beyond
        signal = going & (probability * left.sum(axis=1) < share)
        found[signal] = step
        removed_at[rows[going], farthest[going]] = step
        left = np.where(going[:, None], others, left)
    return (removed_at > 0) & (removed_at <= found[:, None])


def _share(values: Floats, false_alarms: float) -> float:
    """Return the probability of a false alarm for one quantity [Bonferroni]."""
    compared = int((np.isfinite(values).sum(axis=1) >= FEWEST).sum())
    return false_alarms / max(compared, 1)


def _middle(values: Floats, variance: Floats, taken: Flags) -> tuple[Floats, Floats]:
    """Return weighted mean and squared scatter, shape (q,) each.

    The scatter solves sum((x - mean)^2 / (scatter^2 + u^2)) = n - 1, or is zero. Newton's method starts below it, with
    the greatest u for all machines.
    """
    count = taken.sum(axis=1)
    x = np.where(taken, values, 0.0)
    u2 = np.where(taken, variance, 0.0)
    plain = x.sum(axis=1) / np.maximum(count, 1)
    about = np.where(taken, x - plain[:, None], 0.0)
    freedom = np.maximum(count - 1, 1)
    spread = (about**2).sum(axis=1) / freedom
    floor = (_ROUNDED * np.abs(x).max(axis=1, initial=0.0)) ** 2 + np.finfo(float).tiny
    square = np.maximum(spread - u2.max(axis=1, initial=0.0), 0.0)
    mean = np.zeros(len(values))
    for _ in range(_STEPS):
        weight = np.where(taken, 1.0 / (square[:, None] + u2 + floor[:, None]), 0.0)
        mean = (weight * about).sum(axis=1) / np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
        residual = np.where(taken, about - mean[:, None], 0.0)
        excess = (weight * residual**2).sum(axis=1) - freedom
        slope = (weight**2 * residual**2).sum(axis=1)
        step = np.where((excess > 0.0) & (slope > 0.0), excess / np.where(slope > 0.0, slope, 1.0), 0.0)
        square = square + step
        if np.all(step <= _SETTLED * (square + floor)):
            break
    return plain + mean, square + floor


@dataclass(frozen=True, eq=False)
class _Departure:
    """Difference of one machine from the others for each quantity, shape (q,)."""

    off: Floats
    spread: Floats
    freedom: Floats
    middle: Floats
    scatter: Floats

    @property
    def beyond(self) -> Floats:
        """Return the probability of a larger difference by Student's t; NaN gives one half."""
        probability = stdtr(self.freedom, -np.abs(self.off) / self.spread)
        return np.where(np.isfinite(probability), probability, 0.5)


def _departure(values: Floats, variance: Floats, others: Flags, machine: Integers) -> _Departure:
    """Return the difference of one machine from the others for each quantity.

    For unequal uncertainties, the scatter has Satterthwaite's degrees of freedom from its Fisher information
    [Viechtbauer 2005, J. Educ. Behav. Stat. 30, 261].
    """
    rows = np.arange(len(values))
    middle, square = _middle(values, variance, others)
    weight = np.where(others, 1.0 / (square[:, None] + variance), 0.0)
    of_middle = 1.0 / np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
    of_one = square + variance[rows, machine]
    count = np.maximum(others.sum(axis=1), 2)
    information = of_one**2 * (weight**2).sum(axis=1) * (count - 1.0) / count
    freedom = np.clip(information, 1.0, count - 1.0)
    return _Departure(values[rows, machine] - middle, np.sqrt(of_one + of_middle), freedom, middle, np.sqrt(square))


def _scored(values: Floats, u: Floats, unlike: Flags, share: float) -> Sisters:
    variance = np.where(np.isfinite(u), u, 0.0) ** 2
    alike = np.isfinite(values) & ~unlike
    score, middle, scatter, smallest = (np.full(values.shape, np.nan) for _ in range(4))
    for machine in range(values.shape[1]):
        others = alike.copy()
        others[:, machine] = False
        count = others.sum(axis=1)
        shown = np.isfinite(values[:, machine]) & (count >= FEWEST - 1)
        at = np.full(len(values), machine)
        found = _departure(values, variance, others, at)
        limit = -stdtrit(found.freedom, share / (2.0 * (count + 1.0)))
        for of_all, one in (
            (score, -np.sign(found.off) * ndtri(np.maximum(found.beyond, _SMALLEST))),
            (middle, found.middle),
            (scatter, found.scatter),
            (smallest, limit * found.spread),
        ):
            of_all[shown, machine] = one[shown]
    return Sisters(unlike, score, middle, scatter, smallest)
