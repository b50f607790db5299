"""Uneven noise: variance that grows with a variable, or long-tailed innovations."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers

GROWN = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Tried ratios of average growing variance to constant variance."""

TAILS = (2.5, 3.0, 4.0, 6.0, 10.0)
"""Tried degrees of freedom of Student's t."""


def most_probable_variance(powers: Floats, even: Floats, grows: Floats, odds: float) -> tuple[float, Floats]:
    """Return the least cost and each row's most probable variance [Schwarz 1978]."""
    squares = grows / np.maximum(np.mean(grows, axis=0), 1e-300)
    every = np.array(list(product(GROWN, repeat=squares.shape[1])))
    tried = even + np.square(every) @ squares.T
    costs = 0.5 * np.sum(np.log(tried), axis=1) + 0.5 * len(powers) * np.log(np.mean(powers / tried, axis=1))
    priced = costs + 0.5 * np.log(len(powers)) * np.count_nonzero(every, axis=1) + odds
    k = int(np.argmin(priced))
    return float(priced[k]), tried[k]


def spread_by_kind(powers: Floats, kinds: Integers) -> Floats:
    """Return relative standard deviations of rows, estimated by kind, shape (m,)."""
    count = np.maximum(np.bincount(kinds), 1)
    mean = np.bincount(kinds, powers) / count
    own = np.maximum(mean, QUIET**2 * float(mean.max(initial=0.0)))[kinds]
    return np.sqrt(own / max(float(np.mean(own)), 1e-300))


QUIET = 1e-4
"""Least noise of a kind of rows, relative to the largest; less is rounding."""


def most_probable_tails(new: Floats) -> tuple[Floats, float]:
    """Return square roots of innovations' weights, shape (m,), and the best degrees of freedom of Student's t."""
    squares = np.square(new)
    best, found = -np.inf, (np.ones(len(new)), np.inf)
    for tails in TAILS:
        scale = _scale_of(squares, tails)
        likely = _likelihood(new, tails, scale)
        if likely > best:
            best, found = likely, (np.sqrt((tails + 1.0) / (tails + squares / scale)), tails)
    return found


def student_likelihood(new: Floats, tails: float) -> float:
    """Return the log likelihood of Student's t at its best scale, relative to the normal density's height.

    Args:
        tails: degrees of freedom.
    """
    return _likelihood(new, tails, _scale_of(np.square(new), tails))


def widening_of(tails: float) -> float:
    """Return the ratio of an estimate's variance to its variance at fixed weights, (t + 3) / (t + 1) [Lange, Little and Taylor 1989, sec. 3]."""
    return 1.0 + 2.0 / (tails + 1.0)


def _likelihood(new: Floats, tails: float, scale: float) -> float:
    return float(np.sum(log_student(new / np.sqrt(scale), tails))) - 0.5 * len(new) * float(np.log(scale))


def _scale_of(squares: Floats, tails: float) -> float:
    """Return the best squared scale by expectation maximisation [Lange, Little and Taylor, JASA 84 (1989) 881]."""
    scale = 1.0
    for _ in range(BOUNDS.tail_rounds):
        weight = (tails + 1.0) / (tails + squares / scale)
        scale = max(float(np.mean(weight * squares)), 1e-300)
    return scale


def has_long_tails(new: Floats) -> bool:
    """Return whether innovations, shape (m,), favour long tails at best scales."""
    if not np.any(new):
        return False
    scaled = new / np.sqrt(np.mean(np.square(new)))
    return max(student_likelihood(scaled, tails) for tails in TAILS) > -0.5 * len(new)


def log_student(new: Floats, tails: float) -> Floats:
    """Return the log density of Student's t, relative to the normal density's height, shape (m,)."""
    height = gammaln(0.5 * (tails + 1.0)) - gammaln(0.5 * tails) - 0.5 * np.log(0.5 * tails)
    return height - 0.5 * (tails + 1.0) * np.log1p(new**2 / tails)
