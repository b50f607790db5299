"""Residuals of whole periods in harmonics: how strong the noise is, and whether more than noise is left.

Physics that a model lacks is smooth or stepped along a period and lives in the low harmonics; the noise of a channel
reaches far beyond them. The level just above the low ones is therefore taken as the noise that smooth things feel,
whatever its correlation, and never sees a smooth misfit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f as f_distribution

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

LOW = 30
"""Highest harmonic that counts as smooth."""

HIGH = 60
"""Highest harmonic of the band that the noise is read from."""


@dataclass(frozen=True)
class Misfit:
    """What is left beyond noise.

    Attributes:
        probability: of such a misfit or a larger one if only noise were left.
        noise: standard deviation of one sample, as smooth things feel it.
        rms: of what is left beyond noise in the low harmonics; zero where less than noise is left.
        ratio: low over high power, 1 for noise.
    """

    probability: float
    noise: float
    rms: float
    ratio: float


def coefficients(residual: NDArray[np.float64], phase_rad: NDArray[np.float64], highest: int) -> NDArray[np.float64]:
    """Orthonormal Fourier coefficients of a whole period, harmonics 0 to `highest`, shape (2 highest + 1,).

    White noise of standard deviation s has coefficients of standard deviation s, whatever the number of samples.

    Args:
        residual: shape (n,), about equally spaced over the period.
        phase_rad: shape (n,), from 0 to 2 pi [rad].
        highest: below a quarter of the samples.
    """
    return (basis(phase_rad, highest).T @ residual) / np.sqrt(len(residual))


def basis(phase_rad: NDArray[np.float64], highest: int) -> NDArray[np.float64]:
    """Constant, cosines and sines of mean square one, shape (n, 2 highest + 1)."""
    angles = np.outer(phase_rad, np.arange(1, highest + 1))
    return np.hstack([np.ones((len(phase_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


def smooth(residual: NDArray[np.float64], phase_rad: NDArray[np.float64], highest: int = LOW) -> NDArray[np.float64]:
    """Residual without what lies above a harmonic, shape (n,)."""
    columns = basis(phase_rad, highest)
    fitted, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    return np.asarray(columns @ fitted, dtype=np.float64)


def misfit(
    residuals: Sequence[NDArray[np.float64]],
    phases_rad: Sequence[NDArray[np.float64]],
    groups: Sequence[object],
    freedom_used: float,
) -> Misfit:
    """Compare the low harmonics of residuals with the band above them by an F test.

    The first harmonic of each group of runs is left out of it: a common shift there is an effect whose size is only
    roughly known, such as where a ball came to stand. Differences within a group count.

    Args:
        residuals: one whole period per run.
        phases_rad: of the samples [rad].
        groups: what each run shares its first harmonic with.
        freedom_used: degrees of freedom that the fit took out of the low harmonics beside those shifts.
    """
    all_coefficients = np.array(
        [coefficients(residual, phase, HIGH) for residual, phase in zip(residuals, phases_rad, strict=True)]
    )
    first = [1, HIGH + 1]
    for group in set(groups):
        of_group = [k for k, g in enumerate(groups) if g == group]
        all_coefficients[np.ix_(of_group, first)] -= all_coefficients[np.ix_(of_group, first)].mean(axis=0)
    is_low = np.r_[True, np.tile(np.arange(1, HIGH + 1) <= LOW, 2)]
    low = (all_coefficients[:, is_low] ** 2).sum(axis=1)
    high = (all_coefficients[:, ~is_low] ** 2).sum(axis=1)
    high_freedom = 2.0 * (HIGH - LOW) * len(residuals)
    low_freedom = max((2.0 * LOW + 1.0) * len(residuals) - 2.0 * len(set(groups)) - freedom_used, 1.0)
    noise2 = float(high.sum()) / high_freedom
    ratio = float(low.sum()) / low_freedom / noise2 if noise2 > 0.0 else 1.0
    samples = np.mean([len(residual) for residual in residuals])
    excess = max(float(low.sum()) - low_freedom * noise2, 0.0) / len(residuals) / samples
    probability = float(f_distribution.sf(ratio, low_freedom, high_freedom))
    return Misfit(probability, float(np.sqrt(noise2)), float(np.sqrt(excess)), ratio)
