"""Triangular factors of many rows, and least-squares residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

ROUNDING = 1e-9
"""Relative size below which rounding dominates: of singular values or eigenvalues, over the largest; of noise, effects
and changes, over the whole."""


def triangle_of(stacked: Floats) -> Floats:
    """Return the triangular factor of QR, up to signs; refuse NaN and infinity."""
    # Factoring cache-sized slabs first is three times as fast [Demmel, Grigori, Hoemmen and Langou, SIAM J. Sci.
    # Comput. 34 (2012) A206].
    columns = stacked.shape[1]
    slab = max(BOUNDS.slab, 4 * columns)  # each round leaves at most a quarter of the rows
    while len(stacked) >= 2 * slab:
        whole = len(stacked) // slab * slab
        slabs = np.split(stacked[:whole], whole // slab)  # one at a time: a factorisation copies its matrix
        stacked = np.concatenate([*(np.linalg.qr(one, mode="r") for one in slabs), stacked[whole:]])
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"), dtype=np.float64)
    if not np.isfinite(triangle).all():
        raise ValueError("measurements and their derivatives must be numbers")
    return triangle


def norms(columns: Floats) -> Floats:
    """Return the norms of columns, above zero, shape (k,)."""
    return np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def axes_of(columns: Floats, least: float = ROUNDING) -> Floats:
    """Return orthonormal axes of columns, shape (n, k).

    Args:
        least: rank tolerance, relative to the largest singular value of scaled columns.
    """
    u, s, _ = np.linalg.svd(columns / norms(columns), full_matrices=False)
    return u[:, s > least * s[:1]]


def left_by(columns: Floats, values: Floats, rcond: float = ROUNDING) -> Floats:
    """Return the residual of values, shape (n,), after a least-squares fit of columns, shape (n, k)."""
    scaled = columns / norms(columns)
    return values - scaled @ np.linalg.lstsq(scaled, values, rcond=rcond)[0]


def products_of_rows(one: Floats, other: Floats) -> Floats:
    """Return all products of columns, row by row, shape (n, p q)."""
    return (one[:, :, None] * other[:, None, :]).reshape(len(one), -1)


def squares(values: Floats) -> float:
    """Return the sum of squares."""
    return float(np.sum(np.square(values)))


def root(square: float) -> float:
    """Return the root of a square that rounding may make negative."""
    return float(np.sqrt(max(square, 0.0)))


def rms(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
