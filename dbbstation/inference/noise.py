"""How large the noise of a channel is, and how much less its samples say where neighbours resemble each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Noise:
    """Noise of one sample.

    Attributes:
        sigma: standard deviation, in the channel's unit.
        correlation_samples: samples that count as one independent sample; 1 for white noise.
    """

    sigma: float
    correlation_samples: float

    @property
    def effective(self) -> float:
        """Standard deviation of white noise that would leave the same uncertainty of anything smooth."""
        return self.sigma * float(np.sqrt(self.correlation_samples))


def noise_of(residuals: Sequence[NDArray[np.float64]], freedom_used: float) -> Noise:
    """Noise from what a fit leaves, runs apart.

    The correlation is the integrated autocorrelation, summed while pairs of neighbouring lags stay positive
    [Geyer, Practical Markov Chain Monte Carlo, Statistical Science 7 (1992), sec. 3.3].

    Args:
        residuals: one array per run, in time order.
        freedom_used: degrees of freedom that the fit spent.
    """
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


_LAGS = 201
"""Lags looked at, in samples; longer correlations are structure that a model should name, not noise."""


def _autocovariance(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of products at lags 0 to 200."""
    size = next_fast_len(len(residual) + _LAGS, real=True)  # room for the lags: nothing wraps round into them
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    return np.fft.irfft(spectrum, size)[:_LAGS]
