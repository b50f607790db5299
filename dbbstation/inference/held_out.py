"""Prediction of blocks that were left out of the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.square_root import Block, Columns, solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def held_out_rms(
    blocks: Sequence[Block],
    groups: Sequence[int],
    known: Columns,
    active: NDArray[np.int64],
    noise: float,
    held: NDArray[np.float64],
) -> float:
    """Root mean square of what predictions leave of groups of blocks that were left out in turn.

    Random effects that only the left-out blocks know are given the values that suit them best under their priors:
    where a ball came to stand in a mounting says nothing for or against a model of the machine.

    Args:
        blocks: compressed runs.
        groups: group of each block, such as the fold of its test.
        known: priors and scales of all columns.
        active: columns that the model uses, shape (a,).
        noise: standard deviation of one measurement.
        held: directions of the fitted columns to keep at zero, in units of their scales.
    """
    used = Columns(known.prior[active], known.scale[active], known.random[active])
    thin = [_restricted(block, active) for block in blocks]
    square, count = 0.0, 0
    for group in sorted(set(groups)):
        kept = [b for b, g in zip(thin, groups, strict=True) if g != group]
        out = [b for b, g in zip(thin, groups, strict=True) if g == group]
        fitted = solve(kept, used, noise, held)
        square += _left(out, used, fitted.x, noise)
        count += sum(block.count for block in out)
    return float(np.sqrt(square / count))


def _restricted(block: Block, active: NDArray[np.int64]) -> Block:
    """Return the block with the active columns only, numbered by their place among them."""
    place = {int(column): k for k, column in enumerate(active)}
    inside = np.array([int(column) in place for column in block.columns], dtype=bool)
    columns = np.array([place[int(c)] for c in block.columns[inside]], dtype=np.int64)
    return Block(columns, block.triangle[:, inside], block.target, block.count, block.square)


def _left(blocks: Sequence[Block], known: Columns, x: NDArray[np.float64], noise: float) -> float:
    """Sum of squares that is left of blocks once their random effects have settled."""
    size = len(known.prior)
    random = np.flatnonzero(known.random)
    rows, targets = [], []
    for block in blocks:
        wide = np.zeros((len(block.target), size))
        wide[:, block.columns] = block.triangle
        rows.append(wide)
        targets.append(block.target)
    whole, target = np.vstack(rows), np.concatenate(targets)
    fixed = x.copy()
    fixed[random] = 0.0
    remaining = target - whole @ fixed
    stacked = np.vstack([whole[:, random] / noise, np.diag(1.0 / known.prior[random])])
    effects, *_ = np.linalg.lstsq(stacked, np.concatenate([remaining / noise, np.zeros(len(random))]), rcond=None)
    remaining = remaining - whole[:, random] @ effects
    # What the triangles do not hold of the targets lies outside all columns and is left whatever is fitted.
    beyond = sum(block.square - float(block.target @ block.target) for block in blocks)
    return float(remaining @ remaining) + max(beyond, 0.0)
