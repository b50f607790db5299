"""Whether the same candidates are chosen from other parts of the measurement."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.race import race_on, select
from dbbstation.inference.square_root import Block, Columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.race import Candidate

SHARE = 0.7
"""Of the groups of blocks that each draw keeps."""


def stability(
    blocks: Sequence[Block],
    groups: Sequence[int],
    base: Columns,
    held: NDArray[np.float64],
    candidates: Sequence[Candidate],
    noise: float,
    threshold: float,
    most: int,
    draws: int,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Share of draws in which each candidate is chosen again.

    Every draw keeps seven tenths of the groups, without putting any back: a group counted twice would share its
    random effects and look surer than it is. [Meinshausen and Bühlmann, J. R. Stat. Soc. B 72 (2010) 417, sec. 2, draw
    halves for the same purpose]

    Args:
        blocks: compressed runs, columns of the base first.
        groups: which blocks are kept or left out together, such as those of one test.
        base: what is known of the base columns.
        held: directions of the base that are kept at zero.
        candidates: to choose from.
        noise: standard deviation of one measurement.
        threshold: log evidence that a candidate must bring.
        most: candidates at the most.
        draws: how many.
        rng: of the draws.
    """
    first = len(base.prior)
    wanted = np.unique(np.concatenate([np.arange(first), *(v.columns for c in candidates for v in c.variants)]))
    place = {int(column): k for k, column in enumerate(wanted)}
    thin = [_thin(block, place) for block in blocks]
    moved = [
        replace(c, variants=tuple(replace(v, columns=_placed(v.columns, place)) for v in c.variants))
        for c in candidates
    ]
    names = np.array(sorted(set(groups)))
    kept_groups = max(int(np.ceil(SHARE * len(names))), min(len(names), 2))
    times = dict.fromkeys((c.name for c in candidates), 0)
    for _ in range(draws):
        kept = set(rng.choice(names, kept_groups, replace=False).tolist())
        drawn = [block for block, group in zip(thin, groups, strict=True) if group in kept]
        race = race_on(drawn, base, held, len(wanted), noise)
        for choice in select(race, moved, threshold, most):
            times[choice.candidate.name] += 1
    return {name: count / draws for name, count in times.items()}


def _thin(block: Block, place: dict[int, int]) -> Block:
    inside = np.array([int(column) in place for column in block.columns], dtype=bool)
    columns = _placed(block.columns[inside], place)
    stacked = np.linalg.qr(np.column_stack([block.triangle[:, inside], block.target]), mode="r")
    triangle = np.asarray(stacked, dtype=np.float64)
    return Block(columns, triangle[:, :-1], triangle[:, -1], block.count, block.square)


def _placed(columns: NDArray[np.int64], place: dict[int, int]) -> NDArray[np.int64]:
    return np.array([place[int(column)] for column in columns], dtype=np.int64)
