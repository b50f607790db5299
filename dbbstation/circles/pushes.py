"""Distribution of a circle's noise innovations: normal, or with longer or shorter tails.

A range depends on the tails. Likelihood decides between the normal distribution, Student's t (single outliers) and
exp(-|x|^b) (locally louder noise). The kurtosis is unreliable: for t with five degrees of freedom it has no standard
error, and 720 samples give 2.6 instead of 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gamma, gammaln

from dbbstation.computing.arrays import average_of
from dbbstation.inference.coloured import TAILS, student_likelihood

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats

NORMAL = 0.5
"""Prior probability of normal innovations; the tried tails share the other half. Both errors are equally bad, hence one
half."""

EXPONENTS = (1.0, 1.25, 1.5)
"""Tried exponents b of exp(-|x|^b), from the Laplace distribution (1) towards the normal (2)."""

SHORTER = 3.0
"""Standard errors below the normal kurtosis at which shorter tails count. Wrongly shortening an interval is worse than
lengthening it."""

LEAST_BETA = 0.5
"""Parameter of the flattest drawn distribution, the arcsine distribution: no noise has less kurtosis."""


@dataclass(frozen=True, eq=False)
class Pushes:
    """Distribution of innovations with unit variance.

    Attributes:
        weights: probabilities of the normal, of Student's t by `TAILS`, and of exp(-|x|^b) by `EXPONENTS`,
            shape (1 + t + e,).
        excess: kurtosis less 3 if significantly negative; else zero.
    """

    weights: Floats
    excess: float = 0.0

    def drawn(self, rng: np.random.Generator, draws: int, count: int) -> Floats:
        """Draw innovations, shape (draws, count); each series has one kind of tails."""
        # Shorter tails are drawn from the symmetrical beta distribution with excess -6 / (2 a + 3) [Pearson's type II].
        if self.excess < 0.0:
            shape = max(-3.0 / self.excess - 1.5, LEAST_BETA)
            return np.asarray((2.0 * rng.beta(shape, shape, (draws, count)) - 1.0) * np.sqrt(2.0 * shape + 1.0))
        normal = rng.standard_normal((draws, count))
        apart = rng.spawn(1)[0]  # a separate generator, so series with normal tails do not depend on the others
        which = apart.choice(len(self.weights), draws, p=self.weights)
        for number, freedom in enumerate(TAILS, start=1):
            own = np.flatnonzero(which == number)
            squares = apart.chisquare(freedom, (len(own), count))
            normal[own] *= np.sqrt((freedom - 2.0) / squares)
        for number, exponent in enumerate(EXPONENTS, start=1 + len(TAILS)):
            own = np.flatnonzero(which == number)
            sizes = apart.standard_gamma(1.0 / exponent, (len(own), count)) ** (1.0 / exponent)
            unit = np.sqrt(gamma(1.0 / exponent) / gamma(3.0 / exponent))
            normal[own] = np.copysign(unit * sizes, normal[own])
        return normal


_OTHERS = len(TAILS) + len(EXPONENTS)
_NORMAL_ALONE = np.array([1.0] + [0.0] * _OTHERS)

NO_TAILS = Pushes(_NORMAL_ALONE)
"""Normal innovations."""


def pushes_of(white: NDArray[np.complex128], count: int) -> Pushes:
    """Estimate the innovations' distribution from noise lines."""
    pushes = np.fft.irfft(white, count)
    square = average_of(pushes**2)
    if not square > 0.0:
        return NO_TAILS
    scaled = pushes / np.sqrt(square)
    excess = average_of(scaled**4) - 3.0
    # The standard error of a normal kurtosis is sqrt(24 / n) [Kendall and Stuart, The Advanced Theory of Statistics, vol. 1, ch. 12].
    if excess < -SHORTER * sqrt(24.0 / count):
        # Removed lines make the series more normal: its fourth cumulant scales with the square of the remaining share.
        there = float(np.count_nonzero(white)) / len(white)
        return Pushes(_NORMAL_ALONE, excess / there**2)
    likely = np.array(
        [
            -0.5 * count,
            *(student_likelihood(scaled, tails) for tails in TAILS),
            *(_exponential_likelihood(scaled, exponent) for exponent in EXPONENTS),
        ]
    )
    prior = np.array([NORMAL] + [(1.0 - NORMAL) / _OTHERS] * _OTHERS)
    weights = prior * np.exp(likely - likely.max())
    return Pushes(weights / weights.sum())


def _exponential_likelihood(new: Floats, exponent: float) -> float:
    """Return the maximum log likelihood of exp(-|x|^b) over its scale, relative to the normal density's height."""
    scale = float(exponent * np.mean(np.abs(new) ** exponent)) ** (1.0 / exponent)
    height = np.log(exponent) - np.log(2.0 * scale) - float(gammaln(1.0 / exponent)) + 0.5 * np.log(2.0 * np.pi)
    return float(len(new) * (height - 1.0 / exponent))
