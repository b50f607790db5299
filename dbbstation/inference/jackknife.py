"""Uncertainty of a least-squares fit from leaving out its blocks in turn.

Noise that is correlated over less than a block, or larger in some places than in others, is allowed for without a
model of it: what such noise does to the values is seen in how they move. [Tukey 1958; delete-a-group jackknife in Künsch,
The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17 (1989) 1217, sec. 2]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.square_root import spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.square_root import Block


def jackknife_covariance(blocks: Sequence[Block], size: int) -> NDArray[np.float64]:
    """Covariance of least-squares values, shape (k, k).

    Args:
        blocks: compressed runs, at least two; values that one block alone knows come out with a large variance.
        size: number of columns k.
    """
    norm = np.maximum(np.linalg.norm(spread(blocks, size)[:, :-1], axis=0), 1e-300)
    values = []
    for out in range(len(blocks)):
        kept = spread([block for k, block in enumerate(blocks) if k != out], size)
        found, *_ = np.linalg.lstsq(kept[:, :-1] / norm, kept[:, -1], rcond=1e-12)
        values.append(found / norm)
    away = np.array(values) - np.mean(values, axis=0)
    return np.asarray((len(blocks) - 1) / len(blocks) * away.T @ away, dtype=np.float64)
