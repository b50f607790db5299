"""Compress runs to information on their columns; priors of columns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.triangle import triangle_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers


@dataclass(frozen=True, eq=False)
class Block:
    """One run's information on its columns.

    Attributes:
        columns: columns that affect the run, shape (k,).
        triangle: triangular factor of J, shape (r, k), r at most k + 1.
        square: sum of squares of the target, an upper bound of fitted squares.
        noise: of another instrument; None for the channel's noise.
    """

    columns: Integers
    triangle: Floats
    target: Floats
    count: int
    square: float
    noise: float | None = None


def slices(lengths: Iterable[int], first: int = 0) -> list[slice]:
    """Return consecutive slices of given lengths, the first of which starts at `first`."""
    return [slice(*pair) for pair in pairwise(np.cumsum([first, *lengths]).tolist())]


def runs_of(marked: Flags) -> list[slice]:
    """Return the stretches of marked rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int64))).tolist()
    return [slice(*pair) for pair in zip(edges[::2], edges[1::2], strict=True)]


def compress(columns: Integers, jacobian: Floats, target: Floats) -> Block:
    """Compress a run to its triangular factor."""
    stacked = np.column_stack([jacobian, target])
    triangle = triangle_of(stacked)[: jacobian.shape[1] + 1]
    return Block(columns, triangle[:, :-1], triangle[:, -1], len(target), float(target @ target))


def spread(blocks: Sequence[Block], columns: int) -> Floats:
    """Return rows of all blocks over all columns, target last, shape (r, columns + 1)."""
    return spread_over(blocks, np.arange(columns))


def spread_over(blocks: Sequence[Block], columns: Integers) -> Floats:
    """Return rows of all blocks over some columns, target last, shape (r, k + 1)."""
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


@dataclass(frozen=True, eq=False)
class Columns:
    """Prior knowledge of columns.

    Attributes:
        prior: standard deviation about zero, infinite if unknown, shape (k,).
        scale: relevant size, shape (k,); directions with larger uncertainty are undetermined.
        random: random effects, marginalised and not reported, shape (k,).
    """

    prior: Floats
    scale: Floats
    random: Flags


def with_random(known: Columns, sds: Iterable[Floats]) -> Columns:
    """Append random effects with these standard deviations to columns."""
    sd = np.concatenate([np.zeros(0), *sds])
    return Columns(
        np.concatenate([known.prior, sd]),
        np.concatenate([known.scale, sd]),
        np.concatenate([known.random, np.ones(len(sd), dtype=bool)]),
    )
