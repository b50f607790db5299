"""Prediction of blocks that were left out of the fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import Block, Columns, spread
from dbbstation.inference.square_root import Solution, solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True)
class HeldOut:
    """What predictions leave of measurements that were not fitted.

    Attributes:
        rms: root mean square once random effects that only the left-out blocks know have settled under their priors, in
            the channel's unit: where a ball came to stand says nothing for or against a model of the machine.
        normalised: root of the sum of squares in units of its predicted covariance, by noise, random effects and the
            uncertainty of what was fitted, over its degrees of freedom; near 1 where model and uncertainties are right.
    """

    rms: float
    normalised: float


def held_out(
    blocks: Sequence[Block],
    groups: Sequence[int],
    known: Columns,
    active: NDArray[np.int64],
    noise: float,
    held: NDArray[np.float64],
    single: float | None = None,
) -> HeldOut:
    """Leave groups of blocks out in turn and predict them from the others.

    Args:
        blocks: compressed runs.
        groups: group of each block, such as the fold of its test.
        known: priors and scales of all columns.
        active: columns that the model uses, shape (a,).
        noise: standard deviation of one measurement that white noise of the same power at low frequencies would have.
        held: directions of the fitted columns to keep at zero, in units of their scales.
        single: standard deviation of a single measurement, less than `noise` where neighbours resemble each other;
            the same if None.
    """
    used = Columns(known.prior[active], known.scale[active], known.random[active])
    thin = [_restricted(block, active) for block in blocks]
    square, count, weighted, rows = 0.0, 0, 0.0, 0
    for group in sorted(set(groups)):
        kept = [b for b, g in zip(thin, groups, strict=True) if g != group]
        out = [b for b, g in zip(thin, groups, strict=True) if g == group]
        fitted = solve(kept, used, noise, held)
        square += _left(out, used, fitted.x, noise)
        count += sum(block.count for block in out)
        inside, degrees = _weighted(out, fitted, noise if single is None else single)
        weighted += inside
        rows += degrees
    return HeldOut(float(np.sqrt(square / count)), float(np.sqrt(weighted / max(rows, 1))))


def _restricted(block: Block, active: NDArray[np.int64]) -> Block:
    place = {int(column): k for k, column in enumerate(active)}
    inside = np.array([int(column) in place for column in block.columns], dtype=bool)
    columns = np.array([place[int(c)] for c in block.columns[inside]], dtype=np.int64)
    return Block(columns, block.triangle[:, inside], block.target, block.count, block.square)


def _weighted(blocks: Sequence[Block], fitted: Solution, noise: float) -> tuple[float, int]:
    """Sum of squares of what predictions leave, weighted by its predicted covariance, and its degrees of freedom.

    The covariance is noise + W C W^T; with C = F F^T its inverse needs a matrix of C's size only [Woodbury].
    """
    # The last row of a triangle holds the length of what no column reaches, which is not one measurement's noise.
    cut = [Block(b.columns, b.triangle[:-1], b.target[:-1], b.count, b.square) for b in blocks]
    whole, target = np.hsplit(spread(cut, len(fitted.x)), [-1])
    remaining = (target[:, 0] - whole @ fitted.x) / noise
    variance, axes = np.linalg.eigh(fitted.covariance)
    uncertain = whole @ (axes * np.sqrt(np.maximum(variance, 0.0))) / noise
    towards = uncertain.T @ remaining
    explained = towards @ np.linalg.solve(np.eye(len(towards)) + uncertain.T @ uncertain, towards)
    return float(remaining @ remaining - explained), len(remaining)


def _left(blocks: Sequence[Block], known: Columns, x: NDArray[np.float64], noise: float) -> float:
    """Sum of squares that is left of blocks once their random effects have settled."""
    random = np.flatnonzero(known.random)
    whole, target = np.hsplit(spread(blocks, len(known.prior)), [-1])
    fixed = x.copy()
    fixed[random] = 0.0
    remaining = target[:, 0] - whole @ fixed
    stacked = np.vstack([whole[:, random] / noise, np.diag(1.0 / known.prior[random])])
    effects, *_ = np.linalg.lstsq(stacked, np.concatenate([remaining / noise, np.zeros(len(random))]), rcond=None)
    remaining = remaining - whole[:, random] @ effects
    # What the triangles do not hold of the targets lies outside all columns and is left whatever is fitted.
    beyond = sum(block.square - float(block.target @ block.target) for block in blocks)
    return float(remaining @ remaining) + max(beyond, 0.0)
