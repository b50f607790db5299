"""Columns of causes beside a base that is fitted anew with every combination of them.

The base's columns are made orthonormal, with one more row for each prior. What causes have of them is taken out by
projection, which does not square the condition number of the base.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.model_comparison import ModelComparison
from dbbstation.inference.square_root import free_directions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.inference.square_root import Columns

MARGIN = 512
"""Columns for which room is made at first."""


class CauseColumns:
    """Columns of causes over all samples of a channel; they may become more.

    Args:
        samples: of the channel.

    Attributes:
        count: number of columns.
    """

    def __init__(self, samples: int) -> None:
        self._buffer = np.empty((samples, MARGIN), order="F")
        self._products = np.empty((MARGIN, MARGIN))
        self.count = 0

    @property
    def gram(self) -> NDArray[np.float64]:
        """Products of all columns, shape (p, p)."""
        return self._products[: self.count, : self.count]

    @property
    def samples(self) -> NDArray[np.float64]:
        """All columns, shape (n, p)."""
        return self._buffer[:, : self.count]

    def add(self, columns: NDArray[np.float64]) -> NDArray[np.int64]:
        """Take in columns, shape (n, q), and return their numbers."""
        first, last = self.count, self.count + columns.shape[1]
        if last > self._buffer.shape[1]:
            wider = np.empty((len(self._buffer), 2 * last), order="F")
            wider[:, :first] = self._buffer[:, :first]
            products = np.empty((2 * last, 2 * last))
            products[:first, :first] = self.gram
            self._buffer, self._products = wider, products
        self._buffer[:, first:last] = columns
        across = self._buffer[:, :last].T @ self._buffer[:, first:last]
        self._products[:last, first:last] = across
        self._products[first:last, :first] = across[:first].T
        self.count = last
        return np.arange(first, last)


class BesideBase:
    """Causes beside a base.

    Args:
        causes: their columns.
        base: columns of the base, shape (n, k).
        known: priors and scales of these.
        held: orthonormal rows of fitted directions that the base fit kept at zero, in units of the scales. They have
            their usual size here: where they are seen at all, as the curvature of a model lets them be beside very
            little noise, that is no sign of a cause.
        noise: standard deviation of one sample.
    """

    def __init__(
        self,
        causes: CauseColumns,
        base: NDArray[np.float64],
        known: Columns,
        held: NDArray[np.float64],
        noise: float,
    ) -> None:
        random, fitted = np.flatnonzero(known.random), np.flatnonzero(~known.random)
        free = free_directions(known, fitted, held)
        along = known.scale[fitted][:, None] * held.T
        columns = np.hstack([base[:, random] * known.prior[random], base[:, fitted] @ along, base[:, fitted] @ free])
        sized = len(random) + len(held)
        bounded = np.isfinite(known.prior[fitted])
        priors = np.zeros((sized + int(bounded.sum()), columns.shape[1]))
        np.fill_diagonal(priors[:sized], noise)
        # A tolerance bounds a parameter, which free and held directions move together.
        moved = np.hstack([np.zeros((len(fitted), len(random))), along, free])[bounded]
        priors[sized:] = noise * moved / known.prior[fitted][bounded][:, None]
        self._causes, self._noise = causes, noise
        self._axes = np.linalg.qr(np.vstack([columns, priors]))[0][: len(base)]
        self._projections = np.zeros((columns.shape[1], 0))

    @property
    def _of_base(self) -> NDArray[np.float64]:
        """What the columns of the causes have of the base, shape (k, p)."""
        known = self._projections.shape[1]
        if known < self._causes.count:
            more = self._axes.T @ self._causes.samples[:, known:]
            self._projections = np.hstack([self._projections, more])
        return self._projections

    def comparison(self, target: NDArray[np.float64]) -> ModelComparison:
        """Compare causes on a target, shape (n,)."""
        gram = self._causes.gram - self._of_base.T @ self._of_base
        towards = self._causes.samples.T @ target - self._of_base.T @ (self._axes.T @ target)
        return ModelComparison(gram / self._noise**2, towards / self._noise**2)

    def left(self, targets: NDArray[np.float64], sd: NDArray[np.float64]) -> NDArray[np.float64]:
        """What base and causes together leave of targets, shape (n, m).

        Args:
            targets: shape (n, m).
            sd: prior standard deviations of all columns, shape (p,); zero for a column that does not take part.
        """
        used = np.flatnonzero(sd > 0.0)
        size = sd[used] / self._noise
        of_base = self._of_base[:, used] * size
        gram = size[:, None] * self._causes.gram[np.ix_(used, used)] * size - of_base.T @ of_base
        towards = size[:, None] * (self._causes.samples.T @ targets)[used] - of_base.T @ (self._axes.T @ targets)
        values = np.linalg.solve(gram + np.eye(len(used)), towards)
        every = np.zeros((len(sd), targets.shape[1]))
        every[used] = size[:, None] * values
        explained = self._causes.samples @ every
        return targets - explained - self._axes @ (self._axes.T @ (targets - explained))
