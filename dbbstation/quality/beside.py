"""Log densities of assignments of runs to circles that differ in few runs from a given one.

The posterior of the shared effects, given all runs, is computed once. Runs are removed and inserted by blocks
[Rasmussen and Williams (2006), section 5.4.2].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from dbbstation.quality.forms import SIZES as SHARES
from dbbstation.quality.plan_effects import BESIDE, ELSEWHERE, LARGER, log_diagonal
from dbbstation.trace.expected import COEFFICIENTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.quality.plan_effects import PlanEffects, RunEffects

SIZES = np.append(0.0, SHARES)
"""Machine errors relative to their usual size. A simulated machine may have zero errors; every circle then fits any run equally well."""

NEGLIGIBLE = -np.log(np.finfo(float).eps)
"""Log ratio below which a term of a sum is less than the rounding of the sum."""

BLOCKS = 1024
"""Number of blocks for each size that are computed at once. It affects only the time."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of runs under every label.

    Attributes:
        circles: index of the circle whose effects a run has, shape (n, l + 3).
        off: readings minus expectation, shape (n, l + 3, 7) [µm].
        scatter: covariance of the runs' own part, shape (n, l + 3, 7, 7) [µm²].
        alone: half the log determinant of `scatter`, shape (n, l + 3).
    """

    circles: Integers
    off: Floats
    scatter: Floats
    alone: Floats

    @classmethod
    def of(cls, read: Sequence[RunEffects]) -> Readings:
        """Return the readings of runs as arrays."""
        labels = np.append(np.arange(read[0].off.shape[0] - 3), [LARGER, BESIDE, ELSEWHERE])
        return cls(
            np.array([one.shows(labels) for one in read]),
            np.array([one.off for one in read]),
            np.array([one.scatter for one in read]),
            np.array([one.half_log_determinants for one in read]),
        )


class NearAssignments:
    """Log densities near an assignment with given labels.

    Args:
        known: inner products of whitened effects and readings under these labels, shape (p + 1, p + 1).

    Attributes:
        labels: shape (n,).
        log: log density of all readings under the given labels, with equal prior probability for all sizes of machine errors.
    """

    def __init__(self, effects: PlanEffects, readings: Readings, known: Floats, labels: Integers) -> None:
        self._readings, self.labels, shared = readings, labels, effects.shared
        wide = shared.shape[2]
        rows = shared.reshape(-1, wide)
        count, logs, means = len(shared), [], []
        covariance = np.empty((len(SIZES), len(rows), len(rows)))
        for size, products in zip(SIZES, covariance, strict=True):
            scale = effects.scale(size)
            root = np.linalg.cholesky(np.eye(wide) + scale[:, None] * known[:-1, :-1] * scale)
            right = (np.vstack([known[-1:, :-1], rows]) * scale).T
            white = solve_triangular(root, right, lower=True, overwrite_b=True, check_finite=False)
            logs.append(0.5 * (white[:, 0] @ white[:, 0] - known[-1, -1]) - log_diagonal(root))
            np.matmul(white[:, 1:].T, white[:, 1:], out=products)
            means.append(white[:, 1:].T @ white[:, 0])
        blocks = covariance.reshape(len(SIZES), count, COEFFICIENTS, count, COEFFICIENTS)
        self._covariance = blocks.transpose(0, 1, 3, 2, 4)
        self._logs = np.array(logs)
        self._mean = np.reshape(means, (len(SIZES), count, COEFFICIENTS))
        self.log = float(mean_of(self._logs))

    def most(self, runs: Integers, instead: Integers, least: float) -> Floats:
        """Return upper bounds of log densities by size, shape (s, m, j).

        Args:
            runs: shape (m, k).
            instead: their other labels, shape (m, j, k).
            least: bounds below this need not be tight.
        """
        found = np.empty((len(SIZES), *instead.shape[:2]))
        exchanged = self._exchanged(runs, instead)
        for part in _parts(np.flatnonzero(exchanged), runs):
            found[:, part, 0] = self._most_of_exchanged(runs[part], instead[part, 0], least)
        for part in _parts(np.flatnonzero(~exchanged), runs):
            # However well runs are predicted, their readings scatter by their own part.
            alone = np.sum(self._readings.alone[runs[part][:, None, :], instead[part]], axis=2)
            found[:, part] = self._without(runs[part], np.arange(len(SIZES)))[0][:, :, None] - alone
        return found

    def changed(self, runs: Integers, instead: Integers, most: Floats, limit: Floats) -> Floats:
        """Return log densities with other labels of some runs, shape (q,); values below a limit are upper bounds.

        Args:
            runs: shape (q, k).
            instead: their other labels, shape (q, k).
            most: bounds from `most`, shape (s, q).
            limit: shape (q,).
        """
        sizes = np.flatnonzero((most >= limit - NEGLIGIBLE).any(axis=1))
        before = self._readings.circles[runs, self.labels[runs]]
        circles, off, scatter = self._of(runs, instead)
        logs, pull, turned = self._without(runs, sizes, self._between(before, circles, sizes))
        covariance = scatter + self._between(circles, circles, sizes) + turned.mT @ turned
        apart = (off - self._means(circles, sizes))[..., None] + turned.mT @ pull
        white, alone = _whitened(covariance, apart)
        found = most.copy()
        found[sizes] = logs - 0.5 * np.sum(white**2, axis=(2, 3)) - alone
        return mean_of(found)

    def _without(
        self, runs: Integers, sizes: Integers, more: Floats | None = None
    ) -> tuple[Floats, NDArray[np.floating], NDArray[np.floating]]:
        """Return log densities of the other readings, and the removed runs' whitened residuals and further columns."""
        circles, off, scatter = self._of(runs, self.labels[runs])
        apart = (off - self._means(circles, sizes))[..., None]
        columns = apart if more is None else np.concatenate([apart, more], axis=3)
        white, alone = _whitened(scatter - self._between(circles, circles, sizes), columns)
        pull = white[..., :1]
        logs = self._logs[sizes, None] + 0.5 * np.sum(pull**2, axis=(2, 3)) - alone
        return logs + 2.0 * np.sum(self._readings.alone[runs, self.labels[runs]], axis=1), pull, white[..., 1:]

    def _exchanged(self, runs: Integers, instead: Integers) -> Flags:
        """Return whether runs only exchange their circles, shape (m,)."""
        labels = self.labels[runs]
        alike = (np.sort(labels, axis=1) == np.sort(instead[:, 0], axis=1)).all(axis=1)
        return alike & (labels >= 0).all(axis=1) & (instead.shape[1] == 1)

    def _most_of_exchanged(self, runs: Integers, instead: Integers, least: float) -> Floats:
        """Return upper bounds of log densities of runs that exchange their circles, shape (s, m).

        Any multipliers of the readings give a bound [weak duality, Boyd and Vandenberghe, Convex Optimization (2004),
        5.2.2]. These multipliers are optimal if all runs have the same noise.
        """
        labels, precision = self.labels[runs], self._precision[runs]
        at = np.take_along_axis(np.argsort(instead, axis=1), np.argsort(np.argsort(labels, axis=1), axis=1), axis=1)
        shown = np.take_along_axis(runs, at, axis=1)
        circles = self._readings.circles[runs, labels]
        more = self._readings.off[shown, labels] - self._readings.off[runs, labels]
        wider = (self._readings.scatter[shown, labels] - self._readings.scatter[runs, labels])[..., 0, 0]
        # Scatters of one circle differ by noise only, which is equal for all coefficients.
        known = self._readings.alone[runs, labels] - self._readings.alone[shown, labels]
        pull = self._pull[:, runs]
        logs = self._logs[:, None] + np.sum(np.maximum(known, 0.0), axis=1)
        found = logs - np.sum(pull * more, axis=(2, 3)) + 0.5 * np.sum(wider[..., None] * pull**2, axis=(2, 3))
        sizes = np.flatnonzero((found >= least - NEGLIGIBLE).any(axis=1))
        weighed = precision @ more[..., None]
        shared = self._between(circles, circles, sizes) @ weighed.reshape(len(runs), -1, 1)
        weighed = (weighed - precision @ shared.reshape(-1, *weighed.shape))[..., 0]
        square = np.sum(weighed * more, axis=(2, 3))
        pull = pull[sizes]
        better = logs[sizes] - np.sum(pull * more, axis=(2, 3)) - 0.5 * square
        found[sizes] = better + 0.5 * np.sum(wider[..., None] * (pull + weighed) ** 2, axis=(2, 3))
        return found

    @cached_property
    def _precision(self) -> NDArray[np.floating]:
        """Return the inverse covariance of each run's own part, shape (n, 7, 7) [1/µm²]."""
        return np.linalg.inv(self._readings.scatter[np.arange(len(self.labels)), self.labels])

    @cached_property
    def _pull(self) -> Floats:
        """Return the readings multiplied by their inverse covariance, shape (s, n, 7) [1/µm]."""
        every = np.arange(len(self.labels))
        left = self._readings.off[every, self.labels] - self._mean[:, self._readings.circles[every, self.labels]]
        return (self._precision @ left[..., None])[..., 0]

    def _of(self, runs: Integers, labels: Integers) -> tuple[Integers, Floats, Floats]:
        """Return circles, shape (m, k), readings minus expectation, (m, 7 k), and their own covariance, (m, 7 k, 7 k)."""
        off = self._readings.off[runs, labels].reshape(len(runs), COEFFICIENTS * runs.shape[1])
        scatter = np.zeros((*off.shape, off.shape[1]))
        for k in range(runs.shape[1]):
            rows = slice(COEFFICIENTS * k, COEFFICIENTS * (k + 1))
            scatter[:, rows, rows] = self._readings.scatter[runs[:, k], labels[:, k]]
        return self._readings.circles[runs, labels], off, scatter

    def _between(self, one: Integers, other: Integers, sizes: Integers) -> Floats:
        """Return covariances between circles, shape (s, m, 7 k, 7 k) [µm²]."""
        found = self._covariance[sizes[:, None, None, None], one[:, :, None], other[:, None, :]]
        wide = COEFFICIENTS * one.shape[1]
        return found.swapaxes(3, 4).reshape(len(sizes), len(one), wide, wide)

    def _means(self, circles: Integers, sizes: Integers) -> Floats:
        return self._mean[sizes][:, circles].reshape(len(sizes), len(circles), COEFFICIENTS * circles.shape[1])


def _parts(places: Integers, runs: Integers) -> list[Integers]:
    """Return places in parts of limited size."""
    return np.array_split(places, -(-len(places) * runs.shape[1] ** 2 // BLOCKS)) if len(places) else []


def mean_of(logs: Floats) -> Floats:
    """Return the log of the mean density over SIZES, the first axis."""
    return np.asarray(np.logaddexp.reduce(logs, axis=0) - np.log(len(SIZES)))


def _whitened(covariance: Floats, columns: Floats) -> tuple[NDArray[np.floating], Floats]:
    """Return columns multiplied by the inverse root of covariances, and half the covariances' log determinants."""
    # The rows that border a matrix become such products in its Cholesky factor [Golub and Van Loan, 4.2].
    n, k = columns.shape[-2:]
    bordered = np.empty((*columns.shape[:-2], n + k, n + k))
    bordered[..., :n, :n] = covariance
    bordered[..., n:, :n] = columns.mT
    bordered[..., n:, n:] = np.finfo(float).max * np.eye(k)
    root = np.linalg.cholesky(bordered)
    return root[..., n:, :n].mT, log_diagonal(root[..., :n, :n])
