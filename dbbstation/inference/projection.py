"""Columns of causes beside a base that is fitted anew with every combination of them.

The base's columns are made orthonormal once; then, for each level of noise, what lies along them is made orthonormal again
with one more row for each prior. What causes have of them is taken out by projection, which does not square the condition
number of the base.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve

from dbbstation.inference.model_comparison import ModelComparison, cholesky
from dbbstation.inference.square_root import free_directions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.inference.square_root import Columns

MARGIN = 512
"""Columns for which room is made at first, where nobody says how many there will be."""


class CauseColumns:
    """Columns of causes over all samples of a channel, beside those of a base; they may become more.

    Args:
        base: columns of the base, shape (n, k).
        room: columns for which room is made at first; more need a copy of all. Room that stays empty takes no memory.

    Attributes:
        base: the same.
        count: number of columns of causes.
        axes: orthonormal, of all that the base can do, shape (n, k).
        on_axes: columns of the base along these, shape (k, k).
    """

    def __init__(self, base: NDArray[np.float64], room: int = MARGIN) -> None:
        self.base = base
        self.axes, self.on_axes = np.linalg.qr(base)
        self._buffer = np.empty((len(base), room), order="F")
        self._products = np.zeros((0, 0))
        self._along = np.zeros((self.axes.shape[1], 0))
        self.count = 0

    @property
    def samples(self) -> NDArray[np.float64]:
        """All columns, shape (n, p)."""
        return self._buffer[:, : self.count]

    @property
    def gram(self) -> NDArray[np.float64]:
        """Products of all columns, shape (p, p)."""
        known = len(self._products)
        if known < self.count:
            # Many columns at once take a fraction of the time that they take one after the other.
            products = np.empty((self.count, self.count))
            products[:known, :known] = self._products
            products[:, known:] = self.samples.T @ self._buffer[:, known : self.count]
            products[known:, :known] = products[:known, known:].T
            self._products = products
        return self._products

    @property
    def along(self) -> NDArray[np.float64]:
        """What the columns have of the axes of the base, shape (k, p)."""
        known = self._along.shape[1]
        if known < self.count:
            self._along = np.hstack([self._along, self.axes.T @ self._buffer[:, known : self.count]])
        return self._along

    def add(self, columns: NDArray[np.float64]) -> NDArray[np.int64]:
        """Take in columns, shape (n, q), and return their numbers."""
        first, last = self.count, self.count + columns.shape[1]
        if last > self._buffer.shape[1]:
            wider = np.empty((len(self._buffer), 2 * last), order="F")
            wider[:, :first] = self._buffer[:, :first]
            self._buffer = wider
        self._buffer[:, first:last] = columns
        self.count = last
        return np.arange(first, last)

    def but_for(self, rows: NDArray[np.bool_]) -> CauseColumns:
        """The same causes as all other rows show them, the columns themselves shared; targets must be zero in these rows.

        Args:
            rows: that are held back, shape (n,).
        """
        kept = CauseColumns(np.where(rows[:, None], 0.0, self.base), 0)
        out = self.samples[rows]
        kept._buffer, kept.count = self._buffer, self.count
        kept._products = self.gram - out.T @ out
        kept._along = kept.axes.T @ self.samples
        return kept


class BesideBase:
    """Causes beside a base.

    Args:
        causes: their columns, and those of the base.
        known: priors and scales of the base.
        held: orthonormal rows of fitted directions that the base fit kept at zero, in units of the scales. They have
            their usual size here: where they are seen at all, as the curvature of a model lets them be beside very
            little noise, that is no sign of a cause.
        noise: standard deviation of one sample.
    """

    def __init__(self, causes: CauseColumns, known: Columns, held: NDArray[np.float64], noise: float) -> None:
        random, fitted = np.flatnonzero(known.random), np.flatnonzero(~known.random)
        free = free_directions(known, fitted, held)
        usual = known.scale[fitted][:, None] * held.T
        base = causes.on_axes
        columns = np.hstack([base[:, random] * known.prior[random], base[:, fitted] @ usual, base[:, fitted] @ free])
        sized = len(random) + len(held)
        bounded = np.isfinite(known.prior[fitted])
        priors = np.zeros((sized + int(bounded.sum()), columns.shape[1]))
        np.fill_diagonal(priors[:sized], noise)
        # A tolerance bounds a parameter, which free and held directions move together.
        moved = np.hstack([np.zeros((len(fitted), len(random))), usual, free])[bounded]
        priors[sized:] = noise * moved / known.prior[fitted][bounded][:, None]
        self._causes, self._noise = causes, noise
        # Of what lies along the axes of the base, how much its fit takes, given its priors.
        self._taken = np.linalg.qr(np.vstack([columns, priors]))[0][: len(base)].T

    def comparison(self, target: NDArray[np.float64]) -> ModelComparison:
        """Compare causes on a target, shape (n,)."""
        of_base = self._taken @ self._causes.along
        gram = self._causes.gram - of_base.T @ of_base
        towards = self._causes.samples.T @ target - of_base.T @ (self._taken @ (self._causes.axes.T @ target))
        return ModelComparison(gram / self._noise**2, towards / self._noise**2)

    def left(self, targets: NDArray[np.float64], sd: NDArray[np.float64]) -> NDArray[np.float64]:
        """What base and causes together leave of targets, shape (n, m).

        Args:
            targets: shape (n, m).
            sd: prior standard deviations of all columns, shape (p,); zero for a column that does not take part.
        """
        causes, axes = self._causes, self._causes.axes
        used = np.flatnonzero(sd > 0.0)
        size = sd[used] / self._noise
        of_base = self._taken @ (causes.along[:, used] * size)
        gram = size[:, None] * causes.gram[np.ix_(used, used)] * size - of_base.T @ of_base
        towards = size[:, None] * (causes.samples.T @ targets)[used] - of_base.T @ (self._taken @ (axes.T @ targets))
        values = cho_solve((cholesky(gram + np.eye(len(used))), True), towards)
        every = np.zeros((len(sd), targets.shape[1]))
        every[used] = size[:, None] * values
        left = np.asarray(targets - causes.samples @ every, dtype=np.float64)
        return left - axes @ (self._taken.T @ (self._taken @ (axes.T @ left)))
