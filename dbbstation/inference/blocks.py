"""Runs compressed to what they say about their columns, and what is known of the columns beforehand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.triangle import triangle_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Block:
    """All that one run says about its columns.

    Attributes:
        columns: which columns of x it touches, shape (k,).
        triangle: upper triangle of J, shape (r, k), with r at most k + 1.
        target: transformed right-hand side, shape (r,).
        count: measurements that went into it.
        square: sum of squares of the target, which bounds what any fit can explain.
        noise: standard deviation of one measurement where the block does not share the channel's: another
            instrument's readings, whose uncertainty is stated; None for the channel's.
    """

    columns: NDArray[np.int64]
    triangle: NDArray[np.float64]
    target: NDArray[np.float64]
    count: int
    square: float
    noise: float | None = None


def compress(columns: NDArray[np.int64], jacobian: NDArray[np.float64], target: NDArray[np.float64]) -> Block:
    """Compress a run, shapes (k,), (n, k) and (n,), to its triangle."""
    stacked = np.column_stack([jacobian, target])
    triangle = triangle_of(stacked)[: jacobian.shape[1] + 1]
    return Block(columns, triangle[:, :-1], triangle[:, -1], len(target), float(target @ target))


def spread(blocks: Sequence[Block], columns: int, noise: float | None = None) -> NDArray[np.float64]:
    """Rows of all blocks over all columns, target last, shape (r, columns + 1).

    Args:
        blocks: compressed runs.
        noise: standard deviation of one measurement, where a block does not state its own: rows are divided by it, so that all
            weigh alike; None leaves them as they are.
    """
    wide = np.zeros((sum(len(block.target) for block in blocks), columns + 1))
    row = 0
    for block in blocks:
        rows = wide[row : row + len(block.target)]
        rows[:, block.columns] = block.triangle
        rows[:, -1] = block.target
        if noise is not None:
            rows /= noise if block.noise is None else block.noise
        row += len(rows)
    return wide


def spread_over(blocks: Sequence[Block], columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Rows of all blocks over some columns, shape (k,), in their order, target last, shape (r, k + 1); others are left out."""
    order = np.argsort(columns)
    narrow = np.zeros((sum(len(block.target) for block in blocks), len(columns) + 1))
    row = 0
    for block in blocks:
        rows = narrow[row : row + len(block.target)]
        inside = np.isin(block.columns, columns)
        rows[:, order[np.searchsorted(columns, block.columns[inside], sorter=order)]] = block.triangle[:, inside]
        rows[:, -1] = block.target
        row += len(rows)
    return narrow


def joined(blocks: Sequence[Block], columns: int) -> Block:
    """One block over all columns that says what several blocks of one noise say together."""
    if any(block.noise is not None for block in blocks):
        raise ValueError("blocks with a noise of their own cannot be joined with others")
    triangle = triangle_of(spread(blocks, columns))
    return Block(
        columns=np.arange(columns),
        triangle=triangle[:, :-1],
        target=triangle[:, -1],
        count=sum(block.count for block in blocks),
        square=sum(block.square for block in blocks),
    )


@dataclass(frozen=True, eq=False)
class Columns:
    """What is known of the columns of x before the measurement.

    Attributes:
        prior: standard deviation of each column about zero, infinite where nothing is known, shape (k,).
        scale: size at which a column would matter, shape (k,): a direction is lost when the measurement
            leaves it more uncertain than this.
        random: True for random effects, which are averaged over rather than reported, shape (k,).
    """

    prior: NDArray[np.float64]
    scale: NDArray[np.float64]
    random: NDArray[np.bool_]


def with_random(known: Columns, sd: NDArray[np.float64]) -> Columns:
    """What is known of columns and of random effects behind them, with these standard deviations."""
    return Columns(
        np.concatenate([known.prior, sd]),
        np.concatenate([known.scale, sd]),
        np.concatenate([known.random, np.ones(len(sd), dtype=bool)]),
    )
