"""Uncertainty of least squares by omitting each block.

The jackknife includes correlated and uneven noise without a noise model. [Tukey 1958; by groups in Künsch, Annals of
Statistics 17 (1989) 1217, sec. 2]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import compress
from dbbstation.inference.square_root import solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.square_root import Solution


def weighted_jackknife(
    values: Floats,
    variances: Floats,
    without: Floats,
    variances_without: Floats,
) -> Floats:
    """Return jackknife standard uncertainties, shape (p,), weighted by remaining information.

    Args:
        without: values fitted without each part, shape (k, p).
        variances_without: their stated variances, shape (k, p); infinite if a part alone determines the value.
    """
    # If the stated variance is correct, it equals the expected square [weighted jackknife, Wu, Annals of Statistics 14
    # (1986) 1261, eq. 5.1, by value].
    with np.errstate(all="ignore"):
        squares = variances / variances_without * np.square(without - values)
    return np.sqrt(np.sum(np.where(np.isfinite(squares), squares, 0.0), axis=0))


def widening(variances: Floats, moved: Floats, variances_without: Floats) -> Floats:
    """Return factors, shape (p,), from the model's uncertainty to the larger of model and jackknife uncertainty.

    Values of one weak direction have similar factors, so scaled covariances keep combinations. Held values keep factor 1.

    Args:
        variances: shape (p,).
        moved: changes of values without each part, shape (k, p).
        variances_without: shape (k, p).
    """
    found = weighted_jackknife(np.zeros(len(variances)), variances, moved, variances_without)
    return np.maximum(found / np.sqrt(np.where(variances > 0.0, variances, np.inf)), 1.0)


def refits_without(settled: Settled, parts: Sequence[Flags]) -> tuple[Solution, ...]:
    """Refit base and best members without each part, with unchanged selection."""
    bank, channel = settled.bank, settled.channel
    columns, known = bank.jointly(settled.best.members)
    numbers, target = np.arange(columns.shape[1]), bank.target
    blocks = [compress(numbers, columns[rows[channel.kept]], target[rows[channel.kept]]) for rows in parts]
    with np.errstate(all="ignore"):
        return tuple(
            solve([*blocks[:k], *blocks[k + 1 :]], known, settled.noise.innovation, channel.held)
            for k in range(len(blocks))
        )
