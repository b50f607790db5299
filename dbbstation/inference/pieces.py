"""Whitened residuals of fits, and their projections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.triangle import norms

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csr_array

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.coloured import Coloured


@dataclass(frozen=True, eq=False)
class Left:
    """A whitened residual divided by noise, with the fitted directions.

    Attributes:
        axes: orthonormal fitted directions, reduced by priors, shape (n, k).
        whitening: shape (n, n), or None.
        known: `beside` if already computed, shape (n, k).
    """

    rest: Floats
    axes: Floats
    noise: float
    coloured: Coloured
    whitening: csr_array | None
    known: Floats | None = None

    @cached_property
    def towards(self) -> Floats:
        """Return the transposed whitening times `rest`, for products with unwhitened columns, shape (n,)."""
        return self.transposed(self.rest)

    @cached_property
    def beside(self) -> Floats:
        """Return the transposed whitening times `axes`, for products with unwhitened columns, shape (n, k)."""
        return self.transposed(self.axes) if self.known is None else self.known

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


@dataclass(frozen=True, eq=False)
class Fitting:
    """Orthonormal basis of whitened columns with Gaussian priors; extensible.

    Attributes:
        axes: orthonormal basis over rows and one row per prior, shape (n + b, k).
    """

    axes: Floats
    rows: int
    coloured: Coloured
    whitening: csr_array | None

    @classmethod
    def of(cls, columns: Floats, sd: Floats, coloured: Coloured, whitening: csr_array | None) -> Fitting:
        """Return basis of whitened columns with Gaussian priors."""
        none = np.zeros((len(columns), 0))
        return cls(none, len(columns), coloured, whitening).beside(columns, sd)

    def beside(self, columns: Floats, sd: Floats) -> Fitting:
        """Return basis with further columns, shape (n, k); unknown priors are infinite."""
        noise = self.coloured.innovation
        bounded = np.flatnonzero(np.isfinite(sd))
        size = np.where(np.isfinite(sd), sd, noise / norms(columns))
        priors = np.zeros((len(bounded), columns.shape[1]))
        priors[np.arange(len(bounded)), bounded] = 1.0
        old = np.vstack([self.axes, np.zeros((len(priors), self.axes.shape[1]))])
        new = np.vstack([self.without_axes(columns * (size / noise)), priors])
        return replace(self, axes=np.hstack([old, np.linalg.qr(new)[0]]))

    def without_axes(self, columns: Floats) -> Floats:
        """Subtract from columns over noise, shape (n, k), their projection on `axes`; return shape (n + b, k)."""
        new = np.vstack([columns, np.zeros((len(self.axes) - self.rows, columns.shape[1]))])
        for _ in range(2 if self.axes.shape[1] else 0):  # twice is enough [Giraud et al., Numer. Math. 101 (2005) 87]
            new = new - self.axes @ (self.axes.T @ new)
        return new

    def left(self, target: Floats) -> Left:
        """Return the residual of a whitened target, shape (n,)."""
        noise, axes = self.coloured.innovation, self.axes[: self.rows]
        weighted = target / noise
        return Left(weighted - axes @ (axes.T @ weighted), axes, noise, self.coloured, self.whitening)


class LeftBesideOthers:
    """Residuals of a fit with all groups of columns but one."""

    def __init__(
        self,
        fitting: Fitting,
        sd: Floats,
        target: Floats,
        whitened: Callable[[Floats], Floats],
    ) -> None:
        self._fitting, self._target, self._whitened = fitting, target, whitened
        self._size = sd / fitting.coloured.innovation
        self._alone = fitting.left(target)
        self._own = np.zeros((0, len(sd)))
        self._new = np.zeros((len(fitting.axes), len(sd)))
        self._transposed = np.zeros((fitting.rows, len(sd)))
        self._products = np.eye(len(sd))

    def __call__(self, but_for: int, own: Floats) -> Left:
        """Return the residual of the fit without one group of unwhitened columns, shape (n, k)."""
        changed = np.arange(own.shape[1])
        if len(self._own):
            changed = np.flatnonzero((own != self._own).any(axis=0))
        if len(changed):
            self._own = own.copy()
            new = self._fitting.without_axes(self._whitened(own[:, changed]) * self._size[changed])
            self._new[:, changed], self._transposed[:, changed] = new, self._alone.transposed(new[: self._fitting.rows])
            self._products[changed] = new.T @ self._new
            self._products[:, changed] = self._products[changed].T
            self._products[changed, changed] += 1.0
        alone, others = self._alone, np.delete(np.arange(own.shape[1]), but_for)
        root = np.linalg.inv(np.linalg.cholesky(self._products[np.ix_(others, others)])).T
        axes = self._new[: self._fitting.rows, others] @ root
        beside = self._transposed[:, others] @ root
        return replace(
            alone,
            rest=alone.rest - axes @ (axes.T @ self._target) / alone.noise,
            axes=np.hstack([alone.axes, axes]),
            known=np.hstack([alone.beside, beside]),
        )
