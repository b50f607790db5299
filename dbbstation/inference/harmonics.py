"""Noise level and misfit from harmonics of residuals over whole periods.

Missing physics appears in low harmonics. Their noise is extrapolated from high harmonics by a floor plus a first-order
process, S(k) = a + b / (1 + (k / c)²) [Priestley, Spectral Analysis and Time Series, 1981, sec. 4.12].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import fdtrc

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats


LOW = 30
"""Highest harmonic that counts as smooth."""

HIGH = 240
"""Highest harmonic for estimating noise."""

SAMPLES_PER_HARMONIC = 3
"""Least samples per period of the highest harmonic."""

CORNERS = np.geomspace(10.0, 240.0, 17)
"""Tried corners c of the noise spectrum: correlation over at most 6 degrees of the period. Longer correlations are
structure that a model should name."""

WORTH = 2.0
"""Least log likelihood gain of correlated over white noise."""


@dataclass(frozen=True)
class Misfit:
    """The residual beyond noise.

    Attributes:
        noise: white noise per sample with equal low-harmonic power.
        rms: residual in low harmonics beyond noise, at least zero.
    """

    probability: float
    noise: float
    rms: float


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Noise power by harmonic, with its degrees of freedom.

    Attributes:
        power: power of an orthonormal coefficient at 0, 1, ... LOW, shape (LOW + 1,).
        freedom: of the mean power.
    """

    power: Floats
    freedom: float


def coefficients(residual: Floats, phase_rad: Floats, highest: int) -> Floats:
    """Return orthonormal Fourier coefficients of a whole period, harmonics 0 to `highest`, shape (2 highest + 1,) or (..., m).

    White noise s gives coefficients of size s.

    Args:
        phase_rad: 0 to 2 pi, shape (n,).
        highest: below half of the samples.
    """
    columns = residual.reshape(len(residual), -1)
    found = np.column_stack(_sums(list(columns.T), phase_rad, highest))
    both = np.vstack([found[:1].real, np.sqrt(2.0) * found[1:].real, np.sqrt(2.0) * found[1:].imag])
    return both.reshape(2 * highest + 1, *residual.shape[1:]) / np.sqrt(len(residual))


def basis(phase_rad: Floats, highest: int) -> Floats:
    """Return constant, cosines and sines of mean square one, shape (n, 2 highest + 1)."""
    fine, coarse = _waves(phase_rad, highest)
    waves = (coarse[:, None, :] * fine[None, :, :]).reshape(-1, len(phase_rad))[1 : highest + 1].T
    return np.hstack([np.ones((len(phase_rad), 1)), np.sqrt(2.0) * waves.real, np.sqrt(2.0) * waves.imag])


def _waves(phase_rad: Floats, highest: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return waves whose products are harmonics a + q b, ten times faster than cosines."""
    coarse, fine = _counts(highest)
    return _powers(np.exp(1j * phase_rad), fine), _powers(np.exp(1j * BOUNDS.harmonics_at_once * phase_rad), coarse)


def _counts(highest: int) -> tuple[int, int]:
    """Return the numbers of coarse and fine waves, of q b and of a."""
    return highest // BOUNDS.harmonics_at_once + 1, min(BOUNDS.harmonics_at_once, highest + 1)


def _powers(wave: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    found = np.empty((count, len(wave)), dtype=np.complex128)
    found[0] = 1.0
    for k in range(1, count):
        np.multiply(found[k - 1], wave, out=found[k])
    return found


def _sums(values: Sequence[Floats], phase_rad: Floats, highest: int) -> list[NDArray[np.complex128]]:
    total = np.zeros((len(values), *_counts(highest)), dtype=np.complex128)
    for rows in _stretches(len(phase_rad)):
        fine, coarse = _waves(phase_rad[rows], highest)
        for k, column in enumerate(values):
            total[k] += coarse @ (column[rows] * fine).T
    return [sums.ravel()[: highest + 1] for sums in total]


def _stretches(samples: int) -> Iterator[slice]:
    for start in range(0, samples, BOUNDS.samples_at_once):
        yield slice(start, start + BOUNDS.samples_at_once)


def amplitudes(values: Floats, phase_rad: Floats, highest: int) -> NDArray[np.complex128]:
    """Return least-squares harmonics a_k, shape (highest + 1,), so that values are the real part of sum a_k exp(i k phase)."""
    # Normal equations need only sums and differences of harmonics. They are ill-conditioned for incomplete periods,
    # which use the basis instead.
    return amplitudes_of([values], phase_rad, highest)[0]


def amplitudes_of(several: Sequence[Floats], phase_rad: Floats, highest: int) -> list[NDArray[np.complex128]]:
    """Return harmonics of several series at equal phases, as `amplitudes`."""
    moment, *further = _sums([np.ones(len(phase_rad)), *several], phase_rad, 2 * highest)
    order = np.arange(-highest, highest + 1)
    apart = order[None, :] - order[:, None]
    normal = np.where(apart < 0, np.conj(moment[np.abs(apart)]), moment[np.abs(apart)])
    if np.linalg.cond(normal) > WORST_CONDITION:
        fitted, *_ = np.linalg.lstsq(basis(phase_rad, highest), np.column_stack(several), rcond=None)
        waves = np.sqrt(2.0) * (fitted[1 : highest + 1] - 1j * fitted[highest + 1 :])
        return list(np.vstack([fitted[:1].astype(np.complex128), waves]).T)
    right = [np.concatenate([sums[highest:0:-1], np.conj(sums[: highest + 1])]) for sums in further]
    found = np.linalg.solve(normal, np.column_stack(right))[highest:]
    found[1:] *= 2.0  # negative harmonics are conjugates of positive ones
    return list(found.T)


def smooth(residual: Floats, phase_rad: Floats, highest: int = LOW) -> Floats:
    """Return the residual without harmonics above `highest`, by least squares, shape (n,)."""
    return smooth_of([residual], phase_rad, highest)[0]


def smooth_of(several: Sequence[Floats], phase_rad: Floats, highest: int) -> list[Floats]:
    """Return several smoothed residuals at equal phases."""
    if not several:
        return []
    parts = np.zeros((len(several), *_counts(highest)), dtype=np.complex128)
    parts.reshape(len(several), -1)[:, : highest + 1] = amplitudes_of(several, phase_rad, highest)
    found = [np.empty(len(phase_rad)) for _ in several]
    for rows in _stretches(len(phase_rad)):
        fine, coarse = _waves(phase_rad[rows], highest)
        for values, part in zip(found, parts, strict=True):
            values[rows] = ((part @ fine) * coarse).sum(axis=0).real
    return found


WORST_CONDITION = 1e6
"""Largest condition number of normal equations, which lose six of sixteen digits; evenly spaced phases have 1. The
limit is uncritical: phases without 30 degrees have 7e5, without 45 degrees 2e9, and even there the results agree to
1e-6 of the noise."""


def bands(samples: int) -> tuple[int, int]:
    """Return two harmonics: the highest of smooth misfit, and the highest used for noise."""
    high = min(HIGH, max(samples // SAMPLES_PER_HARMONIC, 2))
    return min(LOW, max(high // 4, 1)), high


def misfit(
    residuals: Sequence[Floats],
    phases_rad: Sequence[Floats],
    groups: Sequence[object],
    freedom_used: float,
    noise: Spectrum | None = None,
) -> Misfit:
    """Test low harmonics of residuals against noise by an F test.

    Each group's common first harmonic, such as a ball's place, is excluded.

    Args:
        groups: each run's group with a common first harmonic.
        freedom_used: degrees of freedom of the fit in low harmonics, without shifts.
        noise: None to estimate it from high harmonics.
    """
    low, high = bands(min(len(residual) for residual in residuals))
    mean, by_harmonic = _squares(centred_coefficients(residuals, phases_rad, groups, high), high)
    if noise is None:
        noise = noise_spectrum(by_harmonic[low:], low, 2.0 * len(residuals))
    counts = np.r_[1.0, np.full(low, 2.0)] * len(residuals)
    counts[1] -= 2.0 * len(set(groups))
    freedom = max(float(counts.sum()) - freedom_used, 1.0)
    measured = np.r_[mean, by_harmonic[:low]]
    if not np.all(noise.power > 0.0):
        return Misfit(1.0, 0.0, 0.0)
    ratio = float(np.sum(measured / noise.power)) / freedom
    expected = float(counts @ noise.power) * freedom / max(float(counts.sum()), 1.0)
    samples = np.mean([len(residual) for residual in residuals])
    excess = max(float(measured.sum()) - expected, 0.0) / len(residuals) / samples
    probability = float(fdtrc(freedom, noise.freedom, ratio))
    return Misfit(probability, float(np.sqrt(noise.power[0])), float(np.sqrt(excess)))


def centred_coefficients(
    residuals: Sequence[Floats],
    phases_rad: Sequence[Floats],
    groups: Sequence[object],
    highest: int,
) -> Floats:
    """Return all runs' coefficients less their group's common first harmonic, shape (runs, 2 highest + 1)."""
    found, first = _all_coefficients(residuals, phases_rad, highest), [1, highest + 1]
    for group in set(groups):
        rows = [k for k, g in enumerate(groups) if g == group]
        found[np.ix_(rows, first)] -= found[np.ix_(rows, first)].mean(axis=0)
    return found


def noise_left_by(
    residuals: Sequence[Floats],
    phases_rad: Sequence[Floats],
    of_white: Sequence[Floats],
) -> Spectrum:
    """Estimate noise from high harmonics of the residual of many columns.

    Draws of white noise determine how much noise the columns absorb.

    Args:
        of_white: residuals of these draws, per run, shape (n, draws).
    """
    low, high = bands(min(len(residual) for residual in residuals))
    together = [np.column_stack([one, white]) for one, white in zip(residuals, of_white, strict=True)]
    found = _all_coefficients(together, phases_rad, high)
    _, squares = _squares(found[:, :, 0], high)
    draws = [_squares(found[:, :, k], high)[1] for k in range(1, found.shape[2])]
    freedom = 2.0 * len(residuals)
    share = np.mean(draws, axis=0) / freedom
    # Few draws scatter between harmonics, but the absorbed share changes slowly.
    width = min(BOUNDS.harmonics_averaged, len(share))
    share = np.convolve(np.pad(share, width // 2, mode="edge"), np.full(width, 1.0 / width), mode="valid")[
        : len(squares)
    ]
    above = slice(low, high)
    usable = share[above] > LEAST_LEFT
    if not usable.any():
        return Spectrum(np.zeros(low + 1), 1.0)
    left = np.where(usable, squares[above] / np.maximum(share[above], LEAST_LEFT), np.nan)
    left = np.where(usable, left, np.nanmean(left))
    # The average remaining degrees of freedom, with the power of all.
    usual = float(np.mean(share[above]))
    return noise_spectrum(left * usual, low, freedom * usual)


LEAST_LEFT = 0.02
"""Least remaining share of noise of a usable harmonic or frequency. If columns absorb it completely, priors leave
remains of the effect, not of noise."""


def _all_coefficients(residuals: Sequence[Floats], phases_rad: Sequence[Floats], high: int) -> Floats:
    return np.array([coefficients(r, phase, high) for r, phase in zip(residuals, phases_rad, strict=True)])


def _squares(all_coefficients: Floats, high: int) -> tuple[float, Floats]:
    squares = (all_coefficients**2).sum(axis=0)
    return float(squares[0]), squares[1 : high + 1] + squares[high + 1 :]


def noise_spectrum(squares: Floats, low: int, freedom: float) -> Spectrum:
    """Return the noise spectrum up to `low` from higher harmonics.

    Args:
        low: excluded.
    """
    found = continuations(squares, low, freedom, partial(first_order, corners=CORNERS))
    if found is None:
        white = float((squares / freedom).mean())
        return Spectrum(np.full(low + 1, white), freedom * len(squares))
    weight = np.exp(found.likely - found.likely.max())
    weight /= weight.sum()
    power = weight @ found.powers
    logs = np.log(found.powers.mean(axis=1))
    between = float(weight @ (logs - weight @ logs) ** 2)
    least = 2.0 / (freedom * len(squares))
    return Spectrum(power, 2.0 / max(float(weight @ found.variances) + between, least))


@dataclass(frozen=True, eq=False)
class Continuations:
    """Extrapolated low-harmonic noise for each process.

    Attributes:
        powers: at 0, 1, ... low, shape (processes, low + 1).
        likely: log likelihood of higher harmonics, up to a constant, shape (processes,).
        variances: of the logarithm of mean power, shape (processes,).
    """

    powers: Floats
    likely: Floats
    variances: Floats


def continuations(
    squares: Floats,
    low: int,
    freedom: float,
    processes: Callable[[Floats], Floats],
) -> Continuations | None:
    """Extrapolate noise below `low` by a floor plus each process; None if white.

    Args:
        low: excluded.
        processes: function from harmonics to unscaled powers, shape (processes, h).
    """
    harmonic = np.arange(low + 1.0, low + 1.0 + len(squares))
    mean = squares / freedom
    white = float(mean.mean())
    if not white > 0.0:
        return None
    seen, below = _on_a_floor(processes(harmonic)), _on_a_floor(processes(np.arange(low + 1.0)))
    heights = _fitted(mean, seen)
    powers, likely, variances = [], [], []
    for height, above, under in zip(heights, seen, below, strict=True):
        power = height @ under
        powers.append(power)
        likely.append(_likelihood(mean, height @ above, freedom))
        # Variance of the low mean due to floor and height, from the Fisher information.
        information = 0.5 * freedom * (above / (height @ above)) @ (above / (height @ above)).T
        wanted = (under / power).mean(axis=1)
        variances.append(float(wanted @ np.linalg.pinv(information) @ wanted))
    if max(likely) - _likelihood(mean, np.full(len(mean), white), freedom) < WORTH:
        return None
    return Continuations(np.array(powers), np.array(likely), np.array(variances))


def first_order(harmonic: Floats, corners: Floats) -> Floats:
    """Return the power of unit first-order processes with each corner, shape (processes, h)."""
    return 1.0 / (1.0 + (harmonic / corners[:, None]) ** 2)


def _on_a_floor(power: Floats) -> Floats:
    return np.stack([np.ones_like(power), power], axis=1)


def _fitted(mean: Floats, shapes: Floats) -> Floats:
    """Return non-negative maximum-likelihood floor and height, shape (processes, 2)."""
    power = np.full((len(shapes), len(mean)), mean.mean())
    for _ in range(BOUNDS.spectrum_rounds):
        found = _not_negative(shapes / power[:, None, :], mean / power)
        power = np.maximum(np.einsum("cs,csh->ch", found, shapes), _SMALLEST_SHARE * mean.mean())
    return found


def _not_negative(rows: Floats, values: Floats) -> Floats:
    """Return non-negative least squares by two columns, shape (processes, 2)."""
    # If the solution is negative, a single column is best.
    normal = np.einsum("cih,cjh->cij", rows, rows)
    right = np.einsum("cih,ch->ci", rows, values)
    squares = np.einsum("cii->ci", normal)
    alone = np.maximum(right, 0.0) / squares
    better = np.argmax(alone * right, axis=1)
    edge = np.where(np.arange(2) == better[:, None], alone, 0.0)
    both = np.stack(
        [
            right[:, 0] * squares[:, 1] - right[:, 1] * normal[:, 0, 1],
            right[:, 1] * squares[:, 0] - right[:, 0] * normal[:, 0, 1],
        ],
        axis=1,
    )
    determinant = squares.prod(axis=1) - normal[:, 0, 1] ** 2
    inside = (determinant > _SINGULAR * squares.prod(axis=1)) & np.all(both > 0.0, axis=1)
    return np.where(inside[:, None], both / np.where(inside, determinant, 1.0)[:, None], edge)


_SINGULAR = 1e-12
"""Relative determinant of two columns below which rounding dominates."""

_SMALLEST_SHARE = 1e-6
"""Least power of a fitted harmonic relative to the mean; it prevents division by zero. Rounded recordings have more."""


def _likelihood(mean: Floats, power: Floats, freedom: float) -> float:
    """Return the log likelihood of mean squares under a spectrum [Whittle 1953], up to a constant."""
    if not np.all(power > 0.0):
        return -np.inf
    return -0.5 * freedom * float(np.sum(np.log(power) + mean / power))


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
    covariance = sum(_autocovariance(residual) for residual in residuals if len(residual) >= BOUNDS.lags)
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
    # Misfit and absorption are smooth, so high harmonics give the noise, which is extrapolated. Other residuals count as
    # white noise.
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


def _autocovariance(residual: Floats) -> Floats:
    size = next_fast_len(len(residual) + BOUNDS.lags, real=True)  # padding, so lags do not wrap around
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    return np.fft.irfft(spectrum, size)[: BOUNDS.lags]
