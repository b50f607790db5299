"""Noise: correlated processes with whitening filters and whitened residuals; uneven variance and long tails.

Innovations give the exact likelihood [Brockwell and Davis, Time Series: Theory and Methods, 2nd ed., prop. 5.2.1].
Low-passed, resonant and wandering noise are such processes. Effects are thus compared with noise at their own
frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve_triangular
from scipy.special import gammaln

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import cholesky
from dbbstation.inference.triangle import norms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers


NOTHING = 1e-3
"""Negligible partial autocorrelation, and negligible whitened rms of an effect over the noise: a million rows show either by
one standard deviation."""

STEADY = 0.999
"""Largest partial autocorrelation: noise correlated over more than a thousand rows cannot be distinguished from a trend."""

LEAST_NEW = 1e-3
"""Least innovation over a row's standard deviation, because recordings are rounded."""

DECAYS = np.concatenate([np.arange(0.1, 0.9, 0.1), 1.0 - np.geomspace(0.1, 0.005, 12)])
"""Tried correlations of neighbouring rows in a first-order process, over at most 200 rows. Longer correlations are
structure that a model should name."""

FEWEST_INDEPENDENT = 20.0
"""Least effective number of independent samples of noise, which determines its size to 1 / sqrt(2 * 20), a sixth
[standard deviation of chi-square]. Slower or narrower noise cannot be distinguished from an effect. At 10 the size is
known to a quarter only; at 40 noise correlated over a fortieth of the rows already counts as an effect."""

SHARES = np.geomspace(0.01, 100.0, 33)
"""Tried variances of a first-order process, over the variance of white noise."""

LOG_VARIANCE = np.pi**2 / 6.0
"""Variance of the logarithm of one power."""


SHORTEST_OF_ALL = 16
"""Fewest rows if all stretches are shorter, as in many short runs; at least half of the longest. A low-pass of seven
rows shows in seven frequencies; without a spectrum noise would count as white."""

LOG_MEAN = 0.5772156649
"""Difference between log mean power and mean log power of noise [Euler's constant]."""


@dataclass(frozen=True)
class Coloured:
    """Noise of a channel.

    Attributes:
        partial: partial autocorrelations from lag 1; empty if white.
        told_by: number of free parameters, if fewer than these.
    """

    sigma: float
    partial: tuple[float, ...] = ()
    told_by: int = BOUNDS.order

    @classmethod
    def first_order(cls, sigma: float, share: float, decay: float, turn_rad: float = 0.0) -> Coloured:
        """Return white plus first-order noise, or oscillating noise.

        Args:
            decay: correlation of neighbours, or of the oscillation's envelope.
        """
        lags = np.arange(BOUNDS.order + 1)
        correlation = np.where(lags == 0, 1.0, share * decay**lags * np.cos(turn_rad * lags))
        return cls(sigma, partial_autocorrelations(correlation), 3 if turn_rad else 2)

    @property
    def is_white(self) -> bool:
        """Return whether neighbours are uncorrelated."""
        return not self.partial

    @property
    def order(self) -> int:
        """Return the number of rows that a prediction uses."""
        return len(self.partial)

    @property
    def parameters(self) -> int:
        """Return the number of correlation parameters."""
        return min(self.order, self.told_by)

    @property
    def correlation_samples(self) -> float:
        """Return the number of rows per independent row for smooth effects; 1 if white."""
        return (self.effective / self.sigma) ** 2

    @property
    def effective(self) -> float:
        """Return the standard deviation of white noise with equal power at frequency zero."""
        return self.innovation / abs(float(self.filter.sum()))

    @property
    def innovation(self) -> float:
        """Return the innovation's standard deviation."""
        return self.sigma * float(np.sqrt(self._predictors[1][-1]))

    def with_innovation(self, innovation: float) -> Coloured:
        """Return the noise with another innovation standard deviation."""
        return replace(self, sigma=innovation / float(np.sqrt(self._predictors[1][-1])))

    @cached_property
    def _predictors(self) -> tuple[list[Floats], list[float]]:
        coefficients, left = [np.zeros(0)], [1.0]
        for partial in self.partial:
            coefficients.append(_longer(coefficients[-1], partial))
            left.append(left[-1] * (1.0 - partial**2))
        return coefficients, left

    @cached_property
    def filter(self) -> Floats:
        """Return the whitening filter, shape (p + 1,)."""
        return np.concatenate([[1.0], -self._predictors[0][-1]])

    def log_power(self, frequency: Floats) -> Floats:
        """Return the log spectrum over frequency [cycles per row]; for white noise the log variance."""
        taps = self.filter
        phase = np.exp(-2j * np.pi * np.outer(frequency, np.arange(len(taps))))
        gain = np.abs(phase @ taps) ** 2
        return 2.0 * np.log(self.innovation) - np.log(gain)

    def independent_samples(self, stretches: Sequence[slice]) -> float:
        """Return how many independent samples give as precise a mean square as these stretches."""
        # n / (1 + 2 sum of rho(k)²) = n mean(S)² / mean(S²), S averaged over 1 / n [Bartlett, J. R. Stat. Soc. 98
        # (1935) 536; Priestley 1981, sec. 5.3.2].
        power = np.exp(
            self.log_power((np.arange(BOUNDS.frequencies, dtype=np.float64) + 0.5) / (2.0 * BOUNDS.frequencies))
            - 2.0 * np.log(self.innovation)
        )
        total = 0.0
        for count in (stretch.stop - stretch.start for stretch in stretches):
            together = min(2 ** max(int(np.log2(2.0 * BOUNDS.frequencies / count)), 0), BOUNDS.frequencies)
            averaged = power.reshape(-1, together).mean(axis=1)
            total += count * float(averaged.mean() ** 2 / np.mean(averaged**2))
        return total

    def whitening(self, stretches: Sequence[slice]) -> csr_array | None:
        """Return the matrix that whitens to noise of size `innovation`; None if white."""
        if self.is_white:
            return None
        coefficients, left = self._predictors
        most = len(coefficients) - 1
        rows, columns, values = [], [], []
        for stretch in stretches:
            count = stretch.stop - stretch.start
            for order in range(most + 1):
                # The first rows have fewer predecessors: each lower order applies to one row, the full order to all
                # others.
                own = np.arange(order, count if order == most else min(order + 1, count))
                if not len(own):
                    continue
                scale = float(np.sqrt(left[-1] / left[order]))
                taps = scale * np.concatenate([[1.0], -coefficients[order]])
                for back, tap in enumerate(taps):
                    rows.append(stretch.start + own)
                    columns.append(stretch.start + own - back)
                    values.append(np.full(len(own), tap))
        size = max((stretch.stop for stretch in stretches), default=0)
        flat = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return csr_array(flat, shape=(size, size))

    def unwhitened(self, white: Floats, stretches: Sequence[slice]) -> Floats:
        """Return the rows, shape (n,), that whitening maps to the given ones."""
        whitening = self.whitening(stretches)
        return white if whitening is None else spsolve_triangular(whitening, white)


def _longer(coefficients: Floats, partial: float) -> Floats:
    """Return the predictor of the next order."""
    return np.concatenate([coefficients - partial * coefficients[::-1], [partial]])


def partial_autocorrelations(correlation: Floats) -> tuple[float, ...]:
    """Return partial autocorrelations [Levinson-Durbin recursion], without negligible last values."""
    coefficients, left, found = np.zeros(0), 1.0, []
    for order in range(1, len(correlation)):
        partial = float((correlation[order] - coefficients @ correlation[1:order][::-1]) / left)
        if not abs(partial) < 1.0:
            break  # as exact as the correlations
        partial = float(np.clip(partial, -STEADY, STEADY))
        if left * (1.0 - partial**2) < LEAST_NEW**2:
            break
        coefficients = _longer(coefficients, partial)
        left *= 1.0 - partial**2
        found.append(partial)
    while found and abs(found[-1]) < NOTHING:
        found.pop()
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Bands:
    """Log powers averaged over frequency bands.

    Attributes:
        frequency: mean [cycles per row], shape (b,).
        log_power: bias-corrected mean log power, shape (b,).
    """

    frequency: Floats
    log_power: Floats
    count: Floats


def bands_of(rows: Floats, stretches: Sequence[slice]) -> Bands | None:
    """Return the rows' spectrum; None if stretches are too short.

    Logarithms are robust against unexplained spectral lines.
    """
    frequency, power = [], []
    longest = max((stretch.stop - stretch.start for stretch in stretches), default=0)
    least = BOUNDS.rows_of_spectrum if longest >= BOUNDS.rows_of_spectrum else max(longest // 2, SHORTEST_OF_ALL)
    for stretch in stretches:
        own = rows[stretch]
        if len(own) >= least:
            power.append(np.abs(np.fft.rfft(own)[1 : (len(own) + 1) // 2]) ** 2 / len(own))
            frequency.append(np.arange(1, len(power[-1]) + 1) / len(own))
    if not power:
        return None
    every = np.concatenate(frequency)
    order = np.argsort(every, kind="stable")
    logs = np.log(np.maximum(np.concatenate(power)[order], 1e-300))
    every = every[order]
    edges, width = [0], float(BOUNDS.band_frequencies)
    while edges[-1] + width * 2.0 < len(every):
        edges.append(edges[-1] + int(width))
        width *= BOUNDS.band_ratio
    count = np.diff([*edges, len(every)]).astype(np.float64)
    starts = np.array(edges)
    return Bands(np.add.reduceat(every, starts) / count, np.add.reduceat(logs, starts) / count + LOG_MEAN, count)


def autoregressive(rows: Floats, stretches: Sequence[slice]) -> Coloured:
    """Fit autoregressive noise by forward and backward prediction."""
    # [Burg's method; Percival and Walden, Spectral Analysis for Physical Applications, 1993, sec. 9.5], order by
    # Akaike's criterion for few rows [Hurvich and Tsai, Biometrika 76 (1989) 297].
    ahead = [rows[stretch] for stretch in stretches if stretch.stop - stretch.start > 1]
    count = sum(len(own) for own in ahead)
    power = sum(float(own @ own) for own in ahead) / max(count, 1)
    if not power > 0.0:
        return Coloured(max(float(np.sqrt(power)), 1e-300))
    behind = [own.copy() for own in ahead]
    left, partials = 1.0, []
    best, kept = akaike_cost(0, count), 0
    for order in range(1, min(BOUNDS.order, count // BOUNDS.rows_per_order) + 1):
        pairs = [(a[1:], b[:-1]) for a, b in zip(ahead, behind, strict=True) if len(a) > 1]
        both = sum(float(a @ a) + float(b @ b) for a, b in pairs)
        if not both > 0.0:
            break
        partial = float(np.clip(2.0 * sum(float(a @ b) for a, b in pairs) / both, -STEADY, STEADY))
        if left * (1.0 - partial**2) < LEAST_NEW**2:
            break
        ahead, behind = [a - partial * b for a, b in pairs], [b - partial * a for a, b in pairs]
        left *= 1.0 - partial**2
        partials.append(partial)
        cost = 0.5 * count * float(np.log(left)) + akaike_cost(order, count)
        if cost < best:
            best, kept = cost, order
    return Coloured(float(np.sqrt(power)), tuple(partials[:kept]))


def first_order(bands: Bands, most: float = 1.0, *, oscillates: bool = False) -> Coloured:
    """Fit white plus first-order noise to bands; return white noise if it is not worse.

    Args:
        most: largest phi.
        oscillates: whether to try also oscillations at the bands' frequencies t.
    """
    # Autocovariance: a at lag 0, plus b phi^|k| cos(k t). Spectrum: a + b / 2 times the sum over w ± t of (1 - phi²) /
    # |1 - phi exp(-i w)|² [Priestley, Spectral Analysis and Time Series, 1981, sec. 4.12]. Two or three parameters
    # cannot follow unexplained lines.
    weight = bands.count / LOG_VARIANCE
    worth = float(np.log(bands.count.sum()))

    def distance(shape: Floats) -> tuple[Floats, Floats]:
        away = bands.log_power - np.log(shape)
        level = (away @ weight) / weight.sum()
        return np.square(away - level[..., None]) @ weight, level

    flat, level = distance(np.ones(len(bands.count)))
    best, found = float(flat) - 2.0 * worth, (float(np.exp(0.5 * level)), 0.0, 0.0, 0.0)
    angle = 2.0 * np.pi * bands.frequency
    turns = [0.0, *angle] if oscillates else [0.0]
    for decay, turn in product(DECAYS[most >= DECAYS], turns):
        away = np.stack([angle - turn, angle + turn])
        process = np.mean((1.0 - decay**2) / (1.0 + decay**2 - 2.0 * decay * np.cos(away)), axis=0)
        squares, levels = distance(1.0 + SHARES[:, None] * process)
        k = int(squares.argmin())
        cost = float(squares[k]) + (worth if turn else 0.0)
        if cost < best:
            best = cost
            sigma = float(np.exp(0.5 * levels[k]) * np.sqrt(1.0 + SHARES[k]))
            found = sigma, float(SHARES[k] / (1.0 + SHARES[k])), float(decay), float(turn)
    return Coloured.first_order(*found) if found[1] else Coloured(found[0])


def largest_decay(rows: int) -> float:
    """Return the largest neighbour correlation that leaves `FEWEST_INDEPENDENT` independent samples.

    Their number is n (1 - phi²) / (1 + phi²); zero for too few rows.
    """
    ratio = max(rows / FEWEST_INDEPENDENT, 1.0)
    return float(np.sqrt((ratio - 1.0) / (ratio + 1.0)))


def akaike_cost(parameters: int, rows: int) -> float:
    """Return the cost of fitted parameters in log likelihood [Hurvich and Tsai, Biometrika 76 (1989) 297]."""
    return parameters * rows / max(rows - parameters - 2.0, 1.0)


def with_put_back(noise: Coloured, bands: Floats, taken: Floats, rows: int) -> Coloured:
    """Return the noise with absorbed power restored, with an order that the rows determine.

    Args:
        bands: ascending frequencies [cycles per row], shape (b,).
        taken: log of the remaining share of power, shape (b,).
    """
    frequency = np.linspace(0.0, 0.5, BOUNDS.frequencies + 1)
    power = np.exp(noise.log_power(frequency) - np.interp(frequency, bands, taken))
    covariance = np.fft.irfft(power)[: BOUNDS.order + 1]
    variance = float(covariance[0])
    partials = np.array(partial_autocorrelations(covariance / variance)[: rows // BOUNDS.rows_per_order])
    costs = [akaike_cost(order, rows) for order in range(len(partials) + 1)]
    gains = np.concatenate([[0.0], np.cumsum(0.5 * rows * np.log1p(-(partials**2)))])
    return Coloured(float(np.sqrt(variance)), tuple(partials[: int(np.argmin(costs + gains))].tolist()))


@dataclass(frozen=True, eq=False)
class Left:
    """A whitened residual divided by noise, with the fitted directions.

    Attributes:
        axes: orthonormal fitted directions, reduced by priors, shape (n, k); in Fortran order, so that more are
            appended quickly.
        whitening: shape (n, n), or None.
    """

    rest: Floats
    axes: Floats
    noise: float
    coloured: Coloured
    whitening: csr_array | None

    @classmethod
    def of(cls, columns: Floats, sd: Floats, target: Floats, coloured: Coloured, whitening: csr_array | None) -> Left:
        """Return the residual of a whitened target, shape (n,), beside whitened columns, shape (n, k), with Gaussian priors.

        Args:
            sd: of the priors, shape (k,); infinite if unknown.
        """
        noise = coloured.innovation
        size = np.where(np.isfinite(sd), sd, noise / norms(columns))
        rows = np.vstack([columns * (size / noise), np.eye(len(sd))[np.isfinite(sd)]])
        axes, weighted = np.asfortranarray(np.linalg.qr(rows)[0][: len(columns)]), target / noise
        return cls(weighted - axes @ (axes.T @ weighted), axes, noise, coloured, whitening)

    def also(self, columns: Floats, sd: Floats) -> Left:
        """Return the residual beside further whitened columns, shape (n, q), with finite priors [Woodbury]."""
        own = columns * (sd / self.noise)
        beside = own - self.axes @ (self.axes.T @ own)
        root = np.linalg.inv(cholesky(own.T @ beside + np.eye(len(sd))))
        axes = (root @ beside.T).T
        rest = self.rest - axes @ (root @ (own.T @ self.rest))
        return replace(self, rest=rest, axes=np.hstack([self.axes, axes]))

    @cached_property
    def towards(self) -> Floats:
        """Return the transposed whitening times `rest`, for products with unwhitened columns, shape (n,)."""
        return self.transposed(self.rest)

    @cached_property
    def beside(self) -> Floats:
        """Return the transposed whitening times `axes`, for products with unwhitened columns, shape (n, k)."""
        return self.transposed(self.axes)

    def whitened(self, rows: Floats) -> Floats:
        """Return whitened rows."""
        return rows if self.whitening is None else self.whitening @ rows

    def whitened_part(self, rows: Floats, here: slice, there: slice) -> Floats:
        """Return part of the whitened rows, for rows that are zero outside a slice."""
        if self.whitening is None:
            return rows
        if there.start >= there.stop:
            return rows[:0]
        if len(rows) > BOUNDS.rows_apart * len(self.rest):
            whole = np.zeros((len(self.rest), rows.shape[1]))
            whole[here] = rows
            return self.whitened(whole)[there]
        # Slicing a sparse matrix would take most of the time.
        ends = self.whitening.indptr[there.start : there.stop + 1]
        own = slice(int(ends[0]), int(ends[-1]))
        column = self.whitening.indices[own] - here.start
        inside = (column >= 0) & (column < len(rows))
        taps = np.where(inside, self.whitening.data[own], 0.0)
        return np.add.reduceat(taps[:, None] * rows[np.where(inside, column, 0)], ends[:-1] - ends[0], axis=0)

    def transposed(self, rows: Floats) -> Floats:
        """Return the transposed whitening times rows."""
        return rows if self.whitening is None else self.whitening.T @ rows


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
