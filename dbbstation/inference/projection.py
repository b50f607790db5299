"""Columns of causes with a refitted base projected out.

Base columns are orthonormalised once, then again for each noise, with a row per prior. The projection does not square
the base's condition number.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import ModelComparison, cholesky
from dbbstation.inference.square_root import free_directions

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.square_root import Columns


LEAST_SHARE = 1e-12
"""Least squared share of a base direction in the kept rows that determines it, thousands of times the rounding 2e-16.
Directions of a single omitted run, such as a mounting's, have zero. In diagnoses of two sessions all shares were below
1e-14 or above 4e-4; limits from 1e-14 to 1e-8 give equal answers to a millionth."""


class CauseColumns:
    """Columns of causes over all samples, extensible.

    Args:
        base: shape (n, k).
        whitened: function from columns, shape (m, q), to samples, shape (n, q), called on demand; None for identity.
        parts: first columns, if they are whitened, shape (m, q) each.

    Attributes:
        numbers: columns whose products are computed, if not all.
        axes: orthonormal axes of the base, shape (n, k).
        on_axes: base components along these axes, shape (k, k).
    """

    def __init__(
        self,
        base: Floats,
        whitened: Callable[[Floats], Floats] | None = None,
        room: int = BOUNDS.columns_at_first,
        parts: Sequence[Floats] = (),
    ) -> None:
        self.base = base
        self.axes, self.on_axes = np.linalg.qr(base)
        self._whitened = whitened
        self._buffer = np.empty((len(base), room), order="F")
        self._waiting = list(parts)
        self._ready, self._shared = 0, False
        self._products = np.zeros((0, 0))
        self._along = np.zeros((self.axes.shape[1], 0))
        self._free: list[int] = []
        self._changed: list[int] = []  # replaced columns, whose products and projections are outdated
        self.count = sum(part.shape[1] for part in parts)
        self.numbers: Integers | None = None

    @property
    def samples(self) -> Floats:
        """Return all columns, shape (n, p)."""
        if self._waiting:
            self._make_room(self.count)
        while self._waiting:
            part = np.hstack(self._waiting[: BOUNDS.sums_at_once])
            del self._waiting[: BOUNDS.sums_at_once]  # free the copies early
            first, last = self._ready, self._ready + part.shape[1]
            self._buffer[:, first:last] = part if self._whitened is None else self._whitened(part)
            self._ready = last
        return self._buffer[:, : self.count]

    def copy(self) -> CauseColumns:
        """Return a copy that shares columns; later additions are separate."""
        other: CauseColumns = copy(self)
        other._waiting = list(self._waiting)
        self._free, other._free, other._changed = [], [], list(self._changed)
        # Both append columns and then need separate buffers.
        self._shared = other._shared = True
        return other

    def of(self, columns: Integers) -> Floats:
        """Return some columns, shape (n, q)."""
        if not self._waiting or len(columns) > BOUNDS.columns_apart * self.count:
            return self.samples[:, columns]
        found = np.empty((len(self._buffer), len(columns)), order="F")
        ready = columns < self._ready
        found[:, ready] = self._buffer[:, columns[ready]]
        starts = self._ready + np.cumsum([0, *(part.shape[1] for part in self._waiting)])
        for part, start in zip(self._waiting, starts[:-1], strict=True):
            own = (columns >= start) & (columns < start + part.shape[1])
            if own.any():
                picked = part[:, columns[own] - start]
                found[:, own] = picked if self._whitened is None else self._whitened(picked)
        return found

    @property
    def gram(self) -> Floats:
        """Return all products, shape (p, p)."""
        known = len(self._products)
        if known < self.count:
            # Joint products of many columns take a fraction of the time.
            products = np.empty((self.count, self.count))
            products[:known, :known] = self._products
            products[:, known:] = self.samples.T @ self.samples[:, known:]
            products[known:, :known] = products[:known, known:].T
            self._products = products
        self._renew()
        return self._products

    def own_gram(self) -> Floats:
        """Return a copy of all products, shape (p, p)."""
        return self.gram.copy()

    def _renew(self) -> None:
        changed, self._changed = np.array(self._changed, dtype=np.int64), []
        for known, products in ((len(self._products), True), (self._along.shape[1], False)):
            own = changed[changed < known]
            if not len(own):
                continue
            columns = self.samples[:, own]
            if products:
                self._products[:, own] = self.samples[:, :known].T @ columns
                self._products[own] = self._products[:, own].T
            else:
                self._along[:, own] = self.axes.T @ columns

    @property
    def along(self) -> Floats:
        """Return the columns' components along base axes, shape (k, p)."""
        known = self._along.shape[1]
        if known < self.count:
            self._along = np.hstack([self._along, self.axes.T @ self.samples[:, known:]])
        self._renew()
        return self._along

    def add(self, columns: Floats) -> Integers:
        """Add columns, shape (m, q), reusing freed places, and return their numbers."""
        taken = np.array(self._free[: columns.shape[1]], dtype=np.int64)
        if len(taken):
            self._free = self._free[len(taken) :]
            self._changed += taken.tolist()
            self._buffer[:, taken] = columns[:, : len(taken)]
            columns = columns[:, len(taken) :]
        first, last = self.count, self.count + columns.shape[1]
        if self._whitened is None:
            # No whitening is needed later, and waiting columns would double the memory.
            self._make_room(last)
            self._buffer[:, first:last] = columns
            self._ready = last
        else:
            self._waiting.append(columns)
        self.count = last
        return np.concatenate([taken, np.arange(first, last)])

    def give_back(self, columns: Integers) -> None:
        """Free columns, shape (q,)."""
        if self._whitened is None and not self._shared:
            self._free = sorted({*self._free, *columns.tolist()})

    def _make_room(self, last: int) -> None:
        if last <= self._buffer.shape[1] and not self._shared:
            return
        wider = np.empty(
            (len(self._buffer), self._buffer.shape[1] if last <= self._buffer.shape[1] else 2 * last), order="F"
        )
        wider[:, : self._ready] = self._buffer[:, : self._ready]
        self._buffer, self._shared = wider, False

    def towards(self, target: Floats) -> tuple[Floats, Floats]:
        """Return products of columns, shape (p,), and of axes, shape (k,), with a target, shape (n,)."""
        return self.samples.T @ target, self.axes.T @ target

    def but_for(self, rows: Flags, only: Integers | None = None) -> CauseColumns:
        """Return the causes without some rows, in which targets must be zero.

        Args:
            only: ascending, shape (q,); None for all.
        """
        return _Without(self, rows, only)


class _Without(CauseColumns):
    """Columns without one part's rows."""

    def __init__(self, whole: CauseColumns, rows: Flags, only: Integers | None) -> None:
        self._whole, self.numbers, self.count = whole, only, whole.count
        own = np.arange(whole.count) if only is None else only
        axes, self._out = whole.axes[rows], whole.samples.T[np.ix_(own, np.flatnonzero(rows))]
        share, turned = np.linalg.eigh(np.eye(axes.shape[1]) - axes.T @ axes)
        turned, size = turned[:, share > LEAST_SHARE], np.sqrt(share[share > LEAST_SHARE])
        self._turned = turned / size
        self.on_axes = (turned * size).T @ whole.on_axes
        along = whole.along if only is None else whole.along[:, only]
        self._along_left = self._turned.T @ (along - (self._out @ axes).T)

    def own_gram(self) -> Floats:
        gram, own = self._whole.gram, self.numbers
        return _less(gram.copy() if own is None else gram[np.ix_(own, own)], self._out.T)

    @property
    def along(self) -> Floats:
        return self._along_left

    def towards(self, target: Floats) -> tuple[Floats, Floats]:
        of_columns, of_axes = self._whole.towards(target)
        return of_columns if self.numbers is None else of_columns[self.numbers], self._turned.T @ of_axes


def _less(products: Floats, columns: Floats) -> Floats:
    """Subtract the products of columns, shape (m, q), from the given products, shape (q, q), in place."""
    for first in range(0, len(products) if columns.size else 0, BOUNDS.mirrored_at_once):
        strip, after = slice(first, first + BOUNDS.mirrored_at_once), slice(first + BOUNDS.mirrored_at_once, None)
        products[first:, strip] -= columns[:, first:].T @ columns[:, strip]
        products[strip, after] = products[after, strip].T
    return products


def _factored(products: Floats) -> tuple[Floats, bool]:
    """Factor products, shape (p, p) in Fortran order, in place; return the argument of `cho_solve`."""
    diagonal = products.diagonal().copy()
    try:
        factor, _ = cho_factor(products, lower=True, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        np.fill_diagonal(products, diagonal)
        factor = cholesky(products.T)  # the upper triangle is unchanged
    return factor, True


class BesideBase:
    """Causes with a base projected out.

    Args:
        held: orthonormal directions held at zero in the base fit, in scaled columns. Here they are free with usual
            size, so their nonlinear effects do not look like a cause.
    """

    def __init__(self, causes: CauseColumns, known: Columns, held: Floats, noise: float) -> None:
        random, fitted = np.flatnonzero(known.random), np.flatnonzero(~known.random)
        free = free_directions(known, fitted, held)
        usual = known.scale[fitted][:, None] * held.T
        base = causes.on_axes
        columns = np.hstack([base[:, random] * known.prior[random], base[:, fitted] @ usual, base[:, fitted] @ free])
        sized = len(random) + len(held)
        bounded = np.isfinite(known.prior[fitted])
        priors = np.zeros((sized + int(bounded.sum()), columns.shape[1]))
        np.fill_diagonal(priors[:sized], noise)
        # A tolerance bounds a parameter, which depends on free and held directions.
        moved = np.hstack([np.zeros((len(fitted), len(random))), usual, free])[bounded]
        priors[sized:] = noise * moved / known.prior[fitted][bounded][:, None]
        self._causes, self._noise = causes, noise
        # Share of each base axis that the fit absorbs, given its priors.
        self._taken = np.linalg.qr(np.vstack([columns, priors]))[0][: len(base)].T

    def comparison(self, target: Floats, only: Integers | None = None) -> ModelComparison:
        """Compare causes on a target, shape (n,)."""
        causes = self._causes
        if only is None:
            along, products, (of_columns, of_axes) = causes.along, causes.own_gram(), causes.towards(target)
        else:
            columns = causes.of(only)
            along, products = causes.axes.T @ columns, columns.T @ columns
            of_columns, of_axes = columns.T @ target, causes.axes.T @ target
        of_base = self._taken @ along
        gram = _less(products, of_base)
        towards = of_columns - of_base.T @ (self._taken @ of_axes)
        gram /= self._noise**2
        return ModelComparison(gram, towards / self._noise**2, causes.numbers if only is None else only)

    def left(self, targets: Floats, sd: Floats) -> Floats:
        """Return the residual of base and causes, shape (n, m)."""
        causes, axes = self._causes, self._causes.axes
        used = np.flatnonzero(sd > 0.0)
        size = sd[used] / self._noise
        # Nearly all columns are multiplied in place, because selecting them would copy most of the memory.
        every = len(used) > BOUNDS.columns_apart * causes.count
        columns = causes.samples if every else causes.of(used)
        own = used if every else np.arange(len(used))
        along = causes.along[:, used] if every else axes.T @ columns
        products = (causes.gram.T[np.ix_(used, used)] if every else columns.T @ columns).T  # in Fortran order
        of_base = self._taken @ (along * size)
        # The product matrix has tens of megabytes, so it is changed in place.
        products *= size[:, None]
        products *= size
        products -= of_base.T @ of_base
        products.flat[:: len(used) + 1] += 1.0
        towards = size[:, None] * (columns.T @ targets)[own] - of_base.T @ (self._taken @ (axes.T @ targets))
        values = np.zeros((columns.shape[1], targets.shape[1]))
        values[own] = size[:, None] * cho_solve(_factored(products), towards, check_finite=False)
        left = targets - columns @ values
        return left - axes @ (self._taken.T @ (self._taken @ (axes.T @ left)))
