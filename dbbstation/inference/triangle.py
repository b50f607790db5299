"""Upper triangles of many rows, and residuals of columns beside others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

RANK = 1e-9
"""Share of the largest singular value or eigenvalue of columns below which a direction says nothing."""


def triangle_of(stacked: Floats) -> Floats:
    """Return the QR triangle without signs; refuse NaN and infinity.

    Cache-sized slabs first, three times as fast [Demmel, Grigori, Hoemmen and Langou, SIAM J. Sci. Comput. 34 (2012)
    A206].
    """
    columns = stacked.shape[1]
    slab = max(BOUNDS.slab, 4 * columns)  # each round leaves a quarter of the rows at most
    while len(stacked) >= 2 * slab:
        whole = len(stacked) // slab * slab
        triangles = np.asarray(np.linalg.qr(stacked[:whole].reshape(-1, slab, columns), mode="r"), dtype=np.float64)
        stacked = np.concatenate([triangles.reshape(-1, columns), stacked[whole:]])
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"), dtype=np.float64)
    if not np.isfinite(triangle).all():
        raise ValueError("measurements and their derivatives must be numbers")
    return triangle


def axes_of(columns: Floats, least: float = RANK) -> Floats:
    """Return orthonormal axes of columns, shape (n, k).

    Args:
        least: share of the largest singular value of scaled columns below which a direction is none.
    """
    u, s, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    return np.asarray(u[:, s > least * s[:1]], dtype=np.float64)


def left_by(columns: Floats, values: Floats) -> Floats:
    """Return what columns, shape (n, k), leave of values, shape (n,), by least squares."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=None)[0])


def rms(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
