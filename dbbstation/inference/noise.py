"""Noise of a channel with correlated samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from dbbstation.inference.harmonics import bands, noise_spectrum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats


@dataclass(frozen=True)
class Noise:
    """Noise of one sample.

    Attributes:
        correlation_samples: samples per independent sample; 1 if white.
    """

    sigma: float
    correlation_samples: float

    @property
    def effective(self) -> float:
        """Return the size of white noise that affects smooth quantities equally."""
        return self.sigma * float(np.sqrt(self.correlation_samples))


def noise_of(residuals: Sequence[Floats], freedom_used: float) -> Noise:
    """Estimate noise from the residuals of runs."""
    # The autocorrelation is integrated over positive pairs of lags [Geyer, Practical Markov Chain Monte Carlo,
    # Statistical Science 7 (1992), sec. 3.3].
    count = sum(len(residual) for residual in residuals)
    square = sum(float(residual @ residual) for residual in residuals)
    sigma = float(np.sqrt(square / max(count - freedom_used, 1.0)))
    covariance = sum(_autocovariance(residual) for residual in residuals if len(residual) >= _LAGS)
    if np.ndim(covariance) == 0 or not square > 0.0:
        return Noise(sigma, 1.0)
    correlation = np.asarray(covariance) / np.asarray(covariance)[0]
    pairs = correlation[1:-1:2] + correlation[2::2]
    negative = np.flatnonzero(pairs <= 0.0)
    until = int(negative[0]) if len(negative) else len(pairs)
    return Noise(sigma, max(1.0, 1.0 + 2.0 * float(pairs[:until].sum())))


def noise_of_turns(residuals: Sequence[Floats], freedom_used: float) -> Noise:
    """Estimate noise from residuals of whole turns.

    Args:
        freedom_used: degrees of freedom of smooth columns.
    """
    # Misfit and absorption are smooth, so high harmonics give the noise, which is extrapolated
    # (`dbbstation.inference.harmonics`). Other residuals count as white noise.
    count = sum(len(residual) for residual in residuals)
    square = sum(float(residual @ residual) for residual in residuals)
    turns = [residual for residual in residuals if len(residual) >= FEWEST_SAMPLES]
    white = Noise(float(np.sqrt(square / max(count - freedom_used, 1.0))), 1.0)
    if not turns or not square > 0.0:
        return white
    low, high = bands(min(map(len, turns)))
    lines = [np.abs(np.fft.rfft(turn)) ** 2 / len(turn) for turn in turns]
    squares = 2.0 * np.sum([power[low + 1 : high + 1] for power in lines], axis=0)
    below = noise_spectrum(squares, low, 2.0 * len(turns)).power
    above = float(np.mean(np.concatenate([power[low + 1 :] for power in lines])))
    share = 2.0 * (low + 0.5) / float(np.mean([len(turn) for turn in turns]))
    of_noise = share * float(below.mean()) + (1.0 - share) * above
    # Smooth columns absorb power of low harmonics.
    spent = freedom_used * float(below[0]) / max(of_noise, np.finfo(float).tiny)
    variance = square / max(count - spent, 1.0)
    return Noise(float(np.sqrt(variance)), 1.0 + (float(below[0]) - of_noise) / variance)


FEWEST_SAMPLES = 60
"""Fewest samples of a turn: then at least five harmonics are low, nearly all that geometric errors cause."""

_LAGS = 201
"""Number of lags in samples; longer correlations are structure that a model should name."""


def _autocovariance(residual: Floats) -> Floats:
    size = next_fast_len(len(residual) + _LAGS, real=True)  # padding, so lags do not wrap around
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    return np.fft.irfft(spectrum, size)[:_LAGS]
