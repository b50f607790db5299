"""The distribution of a circle's innovations: normal, or with longer or shorter tails.

A range depends on tails as on standard deviation. Student's t (single outliers) and exp(-|x|^b) (locally louder noise)
compete with the normal by likelihood. The kurtosis is unreliable: with five degrees of freedom it has no standard error,
and 720 samples show 2.6 instead of 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gamma, gammaln

from dbbstation.inference.uneven import TAILS, student_likelihood

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats

NORMAL = 0.5
"""Chance beforehand that pushes are normal; the rest is shared out among the tails that are tried. A wrong choice is as bad in both
directions, hence one half."""

EXPONENTS = (1.0, 1.25, 1.5)
"""Exponents b of exp(-|x|^b) that are tried, from Laplace's distribution, 1, towards the normal one, 2."""

SHORTER = 3.0
"""Standard errors below the kurtosis of a normal distribution from which shorter tails count. Chance that shortens an interval is worse
than chance that makes it longer."""

LEAST_BETA = 0.5
"""Parameter of the flattest distribution that is drawn, that of a sine: no noise has less kurtosis."""


@dataclass(frozen=True, eq=False)
class Pushes:
    """The innovations' distribution, unit variance.

    Attributes:
        weights: of normal, Student's t by `TAILS`, and `EXPONENTS`, shape (1 + t + e,), sum one.
        excess: kurtosis less 3 if below; else zero.
    """

    weights: Floats
    excess: float = 0.0

    def drawn(self, rng: np.random.Generator, draws: int, count: int) -> Floats:
        """Return drawn innovations, each series with own tails, shape (draws, count).

        Shorter tails are symmetrical beta, whose kurtosis less 3 is -6 / (2 a + 3) [Pearson's type II].
        """
        if self.excess < 0.0:
            shape = max(-3.0 / self.excess - 1.5, LEAST_BETA)
            return np.asarray((2.0 * rng.beta(shape, shape, (draws, count)) - 1.0) * np.sqrt(2.0 * shape + 1.0))
        normal = rng.standard_normal((draws, count))
        apart = rng.spawn(1)[0]  # the same normal pushes wherever there are no tails
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
"""Normal pushes."""


def pushes_of(white: NDArray[np.complex128], count: int) -> Pushes:
    """Return the innovations' distribution by noise lines."""
    pushes = np.fft.irfft(white, count)
    square = float(np.mean(pushes**2))
    if not square > 0.0:
        return NO_TAILS
    scaled = pushes / np.sqrt(square)
    excess = float(np.mean(scaled**4)) - 3.0
    # The standard error of a normal kurtosis is sqrt(24 / n) [Kendall and Stuart, The Advanced Theory of Statistics, vol. 1, ch. 12].
    if excess < -SHORTER * float(np.sqrt(24.0 / count)):
        # What is missing makes it more normal: fourth cumulants of the rest keep the square of the share that is there.
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
    """Return the log likelihood of exp(-|x|^b) at its best scale, over the normal density's height."""
    scale = float(exponent * np.mean(np.abs(new) ** exponent)) ** (1.0 / exponent)
    height = np.log(exponent) - np.log(2.0 * scale) - float(gammaln(1.0 / exponent)) + 0.5 * np.log(2.0 * np.pi)
    return float(len(new) * (height - 1.0 / exponent))
