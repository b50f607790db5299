"""Residuals of whole periods in harmonics: how strong the noise is, and whether more than noise is left.

Physics that a model lacks is smooth or stepped along a period and lives in the low harmonics; the noise of a channel
reaches far beyond them. A spectrum fitted to the harmonics above the low ones, continued downwards, is therefore the
noise in the low harmonics, and does not depend on a smooth misfit. It is a floor and a first-order process,
S(k) = a + b / (1 + (k / c)²) [Priestley, Spectral Analysis and Time Series, 1981, sec. 4.12], since neighbouring
samples resemble each other and the low harmonics then hold more noise than the high ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

LOW = 30
"""Highest harmonic that counts as smooth."""

HIGH = 240
"""Highest harmonic that noise is read from."""

SAMPLES_PER_HARMONIC = 3
"""Samples per period of the highest harmonic that is looked at, at the least."""

CORNERS = np.geomspace(10.0, 240.0, 17)
"""Corners c of the noise's spectrum that are tried: neighbours resemble each other over 6 degrees of the period at
the most. What is correlated over more is structure that a model should name."""

WORTH = 2.0
"""Log likelihood that correlation must bring over white noise to be believed."""


@dataclass(frozen=True)
class Misfit:
    """The residual beyond noise.

    Attributes:
        probability: of such a misfit or a larger one if only noise were left.
        noise: standard deviation, per sample, of white noise with the same power at low harmonics.
        rms: of the residual beyond noise in the low harmonics; zero where less than noise is left.
        ratio: power in the low harmonics over what noise alone puts there, 1 for noise.
    """

    probability: float
    noise: float
    rms: float
    ratio: float


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Power of noise by harmonic, and how well it is known.

    Attributes:
        power: at harmonics 0, 1, ... LOW, that of one orthonormal coefficient, shape (LOW + 1,).
        freedom: degrees of freedom that the mean of these would have as a mean of squares.
    """

    power: NDArray[np.float64]
    freedom: float


def coefficients(residual: NDArray[np.float64], phase_rad: NDArray[np.float64], highest: int) -> NDArray[np.float64]:
    """Orthonormal Fourier coefficients of a whole period, harmonics 0 to `highest`, shape (2 highest + 1,) or (..., m).

    White noise of standard deviation s has coefficients of standard deviation s, whatever the number of samples.

    Args:
        residual: shape (n,), or (n, m) for several of the same period; about equally spaced over it.
        phase_rad: shape (n,), from 0 to 2 pi [rad].
        highest: below half of the samples.
    """
    columns = residual.reshape(len(residual), -1)
    found = np.column_stack(_sums(list(columns.T), phase_rad, highest))
    both = np.vstack([found[:1].real, np.sqrt(2.0) * found[1:].real, np.sqrt(2.0) * found[1:].imag])
    return np.asarray(both.reshape(2 * highest + 1, *residual.shape[1:]) / np.sqrt(len(residual)))


def basis(phase_rad: NDArray[np.float64], highest: int) -> NDArray[np.float64]:
    """Constant, cosines and sines of mean square one, shape (n, 2 highest + 1)."""
    fine, coarse = _waves(phase_rad, highest)
    waves = (coarse[:, None, :] * fine[None, :, :]).reshape(-1, len(phase_rad))[1 : highest + 1].T
    return np.hstack([np.ones((len(phase_rad), 1)), np.sqrt(2.0) * waves.real, np.sqrt(2.0) * waves.imag])


def _waves(phase_rad: NDArray[np.float64], highest: int) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Few waves of which harmonic a + AT_ONCE b is the product, shapes (AT_ONCE, n) and (blocks, n).

    Products are ten times as quick as cosines.
    """
    first = np.exp(1j * phase_rad)
    return _powers(first, min(AT_ONCE, highest + 1)), _powers(np.exp(1j * AT_ONCE * phase_rad), highest // AT_ONCE + 1)


def _powers(wave: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """Powers 0 to count - 1, each by one product, shape (count, n)."""
    found = np.empty((count, len(wave)), dtype=np.complex128)
    found[0] = 1.0
    for k in range(1, count):
        np.multiply(found[k - 1], wave, out=found[k])
    return found


def _sums(
    values: Sequence[NDArray[np.float64]], phase_rad: NDArray[np.float64], highest: int
) -> list[NDArray[np.complex128]]:
    """Sums of values times exp(i k phase), k from 0 to `highest`, of each: products of small matrices, no basis is made."""
    total = np.zeros((len(values), highest // AT_ONCE + 1, min(AT_ONCE, highest + 1)), dtype=np.complex128)
    for rows in _stretches(len(phase_rad)):
        fine, coarse = _waves(phase_rad[rows], highest)
        for k, column in enumerate(values):
            total[k] += coarse @ (column[rows] * fine).T
    return [sums.ravel()[: highest + 1] for sums in total]


def _stretches(samples: int) -> Iterator[slice]:
    """Yield the samples in stretches whose waves stay in a processor's cache: twice as quick as all of a long run at once."""
    for start in range(0, samples, STRETCH):
        yield slice(start, start + STRETCH)


STRETCH = 2048
"""Samples whose waves are made at once: half a megabyte."""


def amplitudes(values: NDArray[np.float64], phase_rad: NDArray[np.float64], highest: int) -> NDArray[np.complex128]:
    """Harmonics of values by least squares, shape (highest + 1,): values are about the real part of sum a_k exp(i k phase).

    The cosine of harmonic k has the real part of a_k, its sine the imaginary part with the other sign. The normal equations of
    harmonics have sums and differences of harmonics, so that they are worked out without their basis. Phases that leave part
    of the period out make them ill-conditioned: the basis is then made.

    Args:
        values: shape (n,).
        phase_rad: shape (n,) [rad].
        highest: below half of the samples.
    """
    return amplitudes_of([values], phase_rad, highest)[0]


def amplitudes_of(
    several: Sequence[NDArray[np.float64]], phase_rad: NDArray[np.float64], highest: int
) -> list[NDArray[np.complex128]]:
    """Harmonics of several values at the same phases, each as `amplitudes` has them: one set of normal equations serves all."""
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
    found[1:] *= 2.0  # negative harmonics are the conjugates of positive ones
    return list(found.T)


def smooth(residual: NDArray[np.float64], phase_rad: NDArray[np.float64], highest: int = LOW) -> NDArray[np.float64]:
    """Residual without what lies above a harmonic, by least squares, shape (n,)."""
    return smooth_of([residual], phase_rad, highest)[0]


def smooth_of(
    several: Sequence[NDArray[np.float64]], phase_rad: NDArray[np.float64], highest: int
) -> list[NDArray[np.float64]]:
    """Several residuals at the same phases, each as `smooth` has it."""
    if not several:
        return []
    padded = np.zeros((len(several), (highest // AT_ONCE + 1) * min(AT_ONCE, highest + 1)), dtype=np.complex128)
    padded[:, : highest + 1] = amplitudes_of(several, phase_rad, highest)
    parts = padded.reshape(len(several), highest // AT_ONCE + 1, -1)
    found = [np.empty(len(phase_rad)) for _ in several]
    for rows in _stretches(len(phase_rad)):
        fine, coarse = _waves(phase_rad[rows], highest)
        for values, part in zip(found, parts, strict=True):
            values[rows] = ((part @ fine) * coarse).sum(axis=0).real
    return found


WORST_CONDITION = 1e6
"""Condition of the normal equations above which they lose more than six of sixteen digits; evenly spaced phases have 1. It decides
nothing: phases without 30 degrees have 7e5, without 45 degrees 2e9, and there, too, the basis gives the same to 1e-6 of the noise."""

AT_ONCE = 16
"""Harmonics that are made from one of `basis`'s coarse waves: the root of the number that is usual."""


def bands(samples: int) -> tuple[int, int]:
    """Highest smooth harmonic, and highest that noise is read from, for so many samples per period."""
    high = min(HIGH, max(samples // SAMPLES_PER_HARMONIC, 2))
    return min(LOW, max(high // 4, 1)), high


def misfit(
    residuals: Sequence[NDArray[np.float64]],
    phases_rad: Sequence[NDArray[np.float64]],
    groups: Sequence[object],
    freedom_used: float,
    noise: Spectrum | None = None,
) -> Misfit:
    """Compare the low harmonics of residuals with what noise puts there by an F test.

    The first harmonic of each group of runs is left out of it: a common shift there is an effect whose size is only
    roughly known, such as where a ball came to stand. Differences within a group count.

    Args:
        residuals: one whole period per run.
        groups: what each run shares its first harmonic with.
        freedom_used: degrees of freedom that the fit took out of the low harmonics beside those shifts.
        noise: measured elsewhere; read from the high harmonics of these residuals if None.
    """
    low, high = bands(min(len(residual) for residual in residuals))
    all_coefficients = _all_coefficients(residuals, phases_rad, high)
    first = [1, high + 1]
    for group in set(groups):
        of_group = [k for k, g in enumerate(groups) if g == group]
        all_coefficients[np.ix_(of_group, first)] -= all_coefficients[np.ix_(of_group, first)].mean(axis=0)
    mean, by_harmonic = _squares(all_coefficients, high)
    if noise is None:
        noise = noise_spectrum(by_harmonic[low:], low, 2.0 * len(residuals))
    counts = np.r_[1.0, np.full(low, 2.0)] * len(residuals)
    counts[1] -= 2.0 * len(set(groups))
    freedom = max(float(counts.sum()) - freedom_used, 1.0)
    measured = np.r_[mean, by_harmonic[:low]]
    if not np.all(noise.power > 0.0):
        return Misfit(1.0, 0.0, 0.0, 1.0)
    ratio = float(np.sum(measured / noise.power)) / freedom
    expected = float(counts @ noise.power) * freedom / max(float(counts.sum()), 1.0)
    samples = np.mean([len(residual) for residual in residuals])
    excess = max(float(measured.sum()) - expected, 0.0) / len(residuals) / samples
    probability = float(fdtrc(freedom, noise.freedom, ratio))
    return Misfit(probability, float(np.sqrt(noise.power[0])), float(np.sqrt(excess)), ratio)


def noise_left_by(
    residuals: Sequence[NDArray[np.float64]],
    phases_rad: Sequence[NDArray[np.float64]],
    of_white: Sequence[NDArray[np.float64]],
) -> Spectrum:
    """Noise from what a model of very many columns leaves, in the harmonics above the low ones.

    Such a model takes out a good deal of the noise itself, of some harmonics more than of others. How much is seen from
    what it leaves of white noise of unit size.

    Args:
        residuals: what it leaves of the measurement, one whole period per run.
        of_white: what it leaves of draws of white noise, per run, shape (n, draws).
    """
    low, high = bands(min(len(residual) for residual in residuals))
    together = [np.column_stack([one, white]) for one, white in zip(residuals, of_white, strict=True)]
    found = _all_coefficients(together, phases_rad, high)
    _, squares = _squares(found[:, :, 0], high)
    draws = [_squares(found[:, :, k], high)[1] for k in range(1, found.shape[2])]
    freedom = 2.0 * len(residuals)
    share = np.mean(draws, axis=0) / freedom
    # Few draws scatter from harmonic to harmonic; what a model takes out changes slowly with them.
    width = min(SMOOTHED, len(share))
    share = np.convolve(np.pad(share, width // 2, mode="edge"), np.full(width, 1.0 / width), mode="valid")[
        : len(squares)
    ]
    above = slice(low, high)
    usable = share[above] > LEAST_LEFT
    if not usable.any():
        return Spectrum(np.zeros(low + 1), 1.0)
    left = np.where(usable, squares[above] / np.maximum(share[above], LEAST_LEFT), np.nan)
    left = np.where(usable, left, np.nanmean(left))
    # As many degrees of freedom as are left on average, with the power that all of them would have.
    usual = float(np.mean(share[above]))
    return noise_spectrum(left * usual, low, freedom * usual)


SMOOTHED = 9
"""Harmonics over which the share that a model leaves is averaged."""

LEAST_LEFT = 0.02
"""Share of a harmonic that must be left of it to say anything of the noise there."""


def _all_coefficients(
    residuals: Sequence[NDArray[np.float64]], phases_rad: Sequence[NDArray[np.float64]], high: int
) -> NDArray[np.float64]:
    """Coefficients of all runs, shape (runs, 2 high + 1) or (runs, 2 high + 1, m)."""
    return np.array([coefficients(r, phase, high) for r, phase in zip(residuals, phases_rad, strict=True)])


def _squares(all_coefficients: NDArray[np.float64], high: int) -> tuple[float, NDArray[np.float64]]:
    """Sums of squares over runs: of harmonic 0, and of harmonics 1 to `high`, shape (high,)."""
    squares = (all_coefficients**2).sum(axis=0)
    return float(squares[0]), squares[1 : high + 1] + squares[high + 1 :]


def noise_spectrum(squares: NDArray[np.float64], low: int, freedom: float) -> Spectrum:
    """Spectrum of noise in the harmonics up to `low`, from those above.

    Args:
        squares: sums of squares of the coefficients at harmonics low + 1, low + 2, ..., shape (h,).
        low: highest harmonic that is not among them.
        freedom: degrees of freedom of each sum.
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
    """Noise in the low harmonics as each process lets expect it.

    Attributes:
        powers: of one orthonormal coefficient at harmonics 0, 1, ... low, shape (processes, low + 1).
        likely: log likelihood of the harmonics above, less a constant, shape (processes,).
        variances: of the logarithm of the mean of the powers, shape (processes,).
    """

    powers: NDArray[np.float64]
    likely: NDArray[np.float64]
    variances: NDArray[np.float64]


def continuations(
    squares: NDArray[np.float64],
    low: int,
    freedom: float,
    processes: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> Continuations | None:
    """Continue the spectrum of noise below `low` with a floor and each of some processes; None where it counts as white.

    Args:
        squares: sums of squares of the coefficients at harmonics low + 1, low + 2, ..., shape (h,).
        low: highest harmonic that is not among them.
        freedom: degrees of freedom of each sum.
        processes: their power at harmonics of shape (h,), each of a size of its own, shape (processes, h).
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
        # What floor and height leave uncertain in the low mean, by the information of the likelihood.
        information = 0.5 * freedom * (above / (height @ above)) @ (above / (height @ above)).T
        wanted = (under / power).mean(axis=1)
        variances.append(float(wanted @ np.linalg.pinv(information) @ wanted))
    if max(likely) - _likelihood(mean, np.full(len(mean), white), freedom) < WORTH:
        return None
    return Continuations(np.array(powers), np.array(likely), np.array(variances))


def first_order(harmonic: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power of first-order processes of unit height, one for each corner, shape (processes, h)."""
    return np.asarray(1.0 / (1.0 + (harmonic / corners[:, None]) ** 2))


def _on_a_floor(power: NDArray[np.float64]) -> NDArray[np.float64]:
    """A floor and each of the processes, shape (processes, 2, h)."""
    return np.stack([np.ones_like(power), power], axis=1)


def _fitted(mean: NDArray[np.float64], shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Floor and height, not negative, of greatest likelihood, by reweighted least squares, shape (processes, 2)."""
    power = np.full((len(shapes), len(mean)), mean.mean())
    for _ in range(_ROUNDS):
        found = _not_negative(shapes / power[:, None, :], mean / power)
        power = np.maximum(np.einsum("cs,csh->ch", found, shapes), _SMALLEST_SHARE * mean.mean())
    return found


def _not_negative(rows: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares by two columns at a time, none negative, shape (processes, 2).

    Where the solution has a negative part, the best one lies on an edge: one column alone.

    Args:
        rows: the two columns of each problem, shape (processes, 2, h).
        values: what they are to sum up to, shape (processes, h).
    """
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
"""Share of the product of squares below which the determinant of two columns has no digit left."""

_ROUNDS = 6
_SMALLEST_SHARE = 1e-6


def _likelihood(mean: NDArray[np.float64], power: NDArray[np.float64], freedom: float) -> float:
    """Log likelihood of mean squares under a spectrum [Whittle 1953], less a constant."""
    if not np.all(power > 0.0):
        return -np.inf
    return -0.5 * freedom * float(np.sum(np.log(power) + mean / power))
