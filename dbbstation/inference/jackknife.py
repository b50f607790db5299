"""Uncertainty of a least-squares fit from leaving out its blocks in turn.

Noise that is correlated over less than a block, or larger in some places than in others, is allowed for without a
model of it: what such noise does to the values is seen in how they move. [Tukey 1958; delete-a-group jackknife in Künsch,
The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17 (1989) 1217, sec. 2]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import compress, spread, with_random
from dbbstation.inference.square_root import solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.blocks import Block
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.square_root import Solution


def jackknife_covariance(blocks: Sequence[Block], size: int) -> NDArray[np.float64]:
    """Covariance of least-squares values, shape (k, k).

    Args:
        blocks: compressed runs, at least two; values that one block alone knows come out with a large variance.
    """
    norm = np.maximum(np.linalg.norm(spread(blocks, size)[:, :-1], axis=0), 1e-300)
    values = []
    for out in range(len(blocks)):
        kept = spread([block for k, block in enumerate(blocks) if k != out], size)
        found, *_ = np.linalg.lstsq(kept[:, :-1] / norm, kept[:, -1], rcond=1e-12)
        values.append(found / norm)
    away = np.array(values) - np.mean(values, axis=0)
    return np.asarray((len(blocks) - 1) / len(blocks) * away.T @ away, dtype=np.float64)


def weighted_jackknife(
    values: NDArray[np.float64],
    variances: NDArray[np.float64],
    without: NDArray[np.float64],
    variances_without: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Standard uncertainties from how values move when parts are left out, shape (p,).

    Each part counts by the share of the information that is left without it. So the expected square is the variance where the stated
    variances are right, however unequal the parts are, and a part that alone knows a value says nothing about its spread.
    [weighted jackknife, Wu, Annals of Statistics 14 (1986) 1261, eq. 5.1, for each value by itself]

    Args:
        values: from all parts, shape (p,).
        variances: stated of them, shape (p,).
        without: values without each part, shape (k, p).
        variances_without: stated of these, shape (k, p); not finite where nothing is left that knows the value.
    """
    with np.errstate(all="ignore"):
        squares = variances / variances_without * np.square(without - values)
    return np.asarray(np.sqrt(np.sum(np.where(np.isfinite(squares), squares, 0.0), axis=0)))


def widening(
    variances: NDArray[np.float64], moved: NDArray[np.float64], variances_without: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Factors of standard uncertainties after which each is the larger of model and jackknife, shape (p,).

    Values that the same weak direction makes uncertain get nearly the same factor, so a covariance whose rows and columns are
    multiplied by them still knows combinations better than their parts. A value without variance, which is held, stays held.

    Args:
        variances: stated of the values from all parts, shape (p,).
        moved: by how much the values differ without each part, shape (k, p).
        variances_without: stated of the values without each part, shape (k, p).
    """
    found = weighted_jackknife(np.zeros(len(variances)), variances, moved, variances_without)
    return np.maximum(found / np.sqrt(np.where(variances > 0.0, variances, np.inf)), 1.0)


def refits_without(settled: Settled, parts: Sequence[NDArray[np.bool_]]) -> tuple[Solution, ...]:
    """Base and members of the best hypothesis fitted without each part, in the noise that there is: nothing is chosen anew.

    Args:
        settled: what a comparison came to.
        parts: rows of each, shape (n,).
    """
    bank, channel, members = settled.bank, settled.channel, settled.best.members
    columns = np.hstack([bank.base, *(bank.fitted(member.columns) for member in members)])
    known = with_random(channel.known, np.concatenate([np.zeros(0), *(member.sd for member in members)]))
    numbers, target = np.arange(columns.shape[1]), bank.target
    blocks = [compress(numbers, columns[rows[channel.kept]], target[rows[channel.kept]]) for rows in parts]
    with np.errstate(all="ignore"):
        return tuple(
            solve([*blocks[:k], *blocks[k + 1 :]], known, settled.noise.innovation, channel.held)
            for k in range(len(blocks))
        )
