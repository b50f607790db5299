"""Noise whose neighbours resemble each other: white noise on top of a first-order process, and the filter that makes it white.

Its autocovariance is a for lag 0 and b phi^|k| on top of it for every lag; its spectrum a + b (1 - phi²) / |1 - phi exp(-i w)|²
[Priestley, Spectral Analysis and Time Series, 1981, sec. 4.12]. Rows are predicted from those before them [Levinson-Durbin
recursion; Brockwell and Davis, Time Series: Theory and Methods, 2nd ed., prop. 5.2.1]; what that leaves is white, and an exact
likelihood of all rows. So a wave, a step or a pulse is held against the noise that there is at its own frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

LONGEST = 60
"""Rows that a prediction looks back over, at the most."""

NOTHING = 1e-3
"""Partial autocorrelation from which on a row says nothing more about a later one."""

DECAYS = np.concatenate([np.arange(0.1, 0.9, 0.1), 1.0 - np.geomspace(0.1, 0.005, 12)])
"""Values of phi that are tried: neighbours resemble each other over 200 rows at the most. What is alike over more is structure
that a model should name."""

SHARES = np.geomspace(0.01, 100.0, 33)
"""Ratios b / a that are tried."""

FEWEST = 6
"""Frequencies in a band of a spectrum, at the least."""

WIDER = 1.2
"""Ratio of the widths of neighbouring bands."""

SHORTEST = 64
"""Rows of a stretch that a spectrum is taken of."""

LOG_MEAN = 0.5772156649
"""By how much the mean of log power lies below the log of its mean, for noise [Euler's constant]."""

LOG_VARIANCE = np.pi**2 / 6.0
"""Variance of the log of one power."""


@dataclass(frozen=True)
class Coloured:
    """Noise of a channel.

    Attributes:
        sigma: standard deviation of one row, in the unit of the residual.
        share: part of its variance that belongs to the first-order process, from 0 to 1.
        decay: correlation of that from one row to the next.
    """

    sigma: float
    share: float = 0.0
    decay: float = 0.0

    @property
    def is_white(self) -> bool:
        """Whether neighbours do not resemble each other."""
        return self.share == 0.0

    @property
    def correlation_samples(self) -> float:
        """Rows that count as one independent row for anything smooth; 1 for white noise."""
        return 1.0 + 2.0 * self.share * self.decay / (1.0 - self.decay)

    @property
    def effective(self) -> float:
        """Standard deviation of white noise with the same power at frequency zero."""
        return self.sigma * float(np.sqrt(self.correlation_samples))

    @property
    def innovation(self) -> float:
        """Standard deviation of what is new in a row."""
        return self.sigma * float(np.sqrt(self._predictors[1][-1]))

    def with_innovation(self, innovation: float) -> Coloured:
        """The same at a level where so much is new in a row."""
        return Coloured(innovation / float(np.sqrt(self._predictors[1][-1])), self.share, self.decay)

    def autocorrelation(self, lags: NDArray[np.int64]) -> NDArray[np.float64]:
        """Correlation of rows so far apart."""
        return np.where(lags == 0, 1.0, self.share * self.decay ** np.abs(lags).astype(np.float64))

    @cached_property
    def _predictors(self) -> tuple[list[NDArray[np.float64]], list[float]]:
        """Coefficients of predictions from 0, 1, ... rows before, and the share of the variance that each leaves."""
        rho = self.autocorrelation(np.arange(LONGEST + 1))
        coefficients, left = [np.zeros(0)], [1.0]
        for order in range(1, LONGEST + 1):
            before = coefficients[-1]
            partial = float((rho[order] - before @ rho[1:order][::-1]) / left[-1])
            if abs(partial) < NOTHING:
                break
            coefficients.append(np.concatenate([before - partial * before[::-1], [partial]]))
            left.append(left[-1] * (1.0 - partial**2))
        return coefficients, left

    @property
    def filter(self) -> NDArray[np.float64]:
        """Coefficients that take a row and those before it to what is new in it, shape (p + 1,)."""
        return np.concatenate([[1.0], -self._predictors[0][-1]])

    def gain(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Power gain of the filter at frequencies [cycles per row]."""
        taps = self.filter
        phase = np.exp(-2j * np.pi * np.outer(frequency, np.arange(len(taps))))
        return np.asarray(np.abs(phase @ taps) ** 2, dtype=np.float64)

    def whitening(self, stretches: Sequence[slice]) -> csr_array | None:
        """Matrix that makes noise of rows white with the standard deviation `innovation`; None where it is white.

        Args:
            stretches: rows that follow one another without a gap, covering all rows in order.
        """
        if self.is_white:
            return None
        coefficients, left = self._predictors
        most = len(coefficients) - 1
        rows, columns, values = [], [], []
        for stretch in stretches:
            count = stretch.stop - stretch.start
            for order in range(most + 1):
                # The first rows have fewer before them; each order serves one row but the last, which serves the rest.
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


@dataclass(frozen=True, eq=False)
class Bands:
    """Powers of rows by frequency, averaged over bands as logs.

    Attributes:
        frequency: mean of each band [cycles per row], shape (b,).
        log_power: mean log of the power, made that of the mean power of noise, shape (b,).
        count: frequencies in each, shape (b,).
    """

    frequency: NDArray[np.float64]
    log_power: NDArray[np.float64]
    count: NDArray[np.float64]


def bands_of(rows: NDArray[np.float64], stretches: Sequence[slice]) -> Bands | None:
    """Spectrum of rows; None where no stretch is long enough.

    Logs are averaged, so that a few lines, which are waves that nobody has found yet, hardly raise a band.
    """
    frequency, power = [], []
    for stretch in stretches:
        own = rows[stretch]
        if len(own) >= SHORTEST:
            power.append(np.abs(np.fft.rfft(own)[1 : (len(own) + 1) // 2]) ** 2 / len(own))
            frequency.append(np.arange(1, len(power[-1]) + 1) / len(own))
    if not power:
        return None
    every = np.concatenate(frequency)
    order = np.argsort(every, kind="stable")
    logs = np.log(np.maximum(np.concatenate(power)[order], 1e-300))
    every = every[order]
    edges, width = [0], float(FEWEST)
    while edges[-1] + width * 2.0 < len(every):
        edges.append(edges[-1] + int(width))
        width *= WIDER
    count = np.diff([*edges, len(every)]).astype(np.float64)
    starts = np.array(edges)
    return Bands(np.add.reduceat(every, starts) / count, np.add.reduceat(logs, starts) / count + LOG_MEAN, count)


def coloured_noise(bands: Bands) -> Coloured:
    """White noise on top of a first-order process whose spectrum is nearest to bands; white where nothing more is worth it."""
    weight = bands.count / LOG_VARIANCE

    def distance(shape: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        away = bands.log_power - np.log(shape)
        level = (away @ weight) / weight.sum()
        return np.square(away - level[..., None]) @ weight, level

    flat, level = distance(np.ones(len(bands.count)))
    best, found = float(flat) - 2.0 * float(np.log(bands.count.sum())), Coloured(float(np.exp(0.5 * level)))
    turned = 2.0 * np.cos(2.0 * np.pi * bands.frequency)
    for decay in DECAYS:
        process = (1.0 - decay**2) / (1.0 + decay**2 - decay * turned)
        squares, levels = distance(1.0 + SHARES[:, None] * process)
        k = int(squares.argmin())
        if squares[k] < best:
            best = float(squares[k])
            sigma = float(np.exp(0.5 * levels[k]) * np.sqrt(1.0 + SHARES[k]))
            found = Coloured(sigma, float(SHARES[k] / (1.0 + SHARES[k])), float(decay))
    return found
