"""How often causes are chosen from subsets."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import spread_over
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.hypotheses import CLOSE, search
from dbbstation.inference.projection import BesideBase, CauseColumns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.blocks import Block, Columns
    from dbbstation.inference.model_comparison import Cause, Member

SHARE = 0.7
"""Of the groups of blocks that each draw keeps."""


def selection_frequency(
    blocks: Sequence[Block],
    groups: Sequence[int],
    known: Columns,
    held: NDArray[np.float64],
    causes: Sequence[Cause],
    noise: float,
    rng: np.random.Generator,
    begin: Sequence[Member] = (),
    most_members: int | None = None,
) -> dict[str, float]:
    """Return each cause's share of selections.

    Each draw keeps seven tenths of the groups without replacement, because repeated groups look certain [Meinshausen
    and Bühlmann, J. R. Stat. Soc. B 72 (2010) 417, sec. 2, draw halves]. Groups, such as tests, are kept together.
    `held` base directions stay zero.
    """
    base = len(known.prior)
    columns = (
        base + 1 + max(int(part.max(initial=-1)) for c in causes for v in c.variants for part in (v.columns, v.slack))
    )
    names = np.array(sorted(set(groups)))
    kept_groups = max(int(np.ceil(SHARE * len(names))), min(len(names), 2))
    group_of = np.repeat(groups, [len(block.target) for block in blocks])
    rows = spread_over(blocks, np.arange(base))
    every, target = CauseColumns(rows[:, :-1].copy(), room=columns - base), rows[:, -1].copy()
    for first in range(base, columns, BOUNDS.selection_columns):
        every.add(spread_over(blocks, np.arange(first, min(first + BOUNDS.selection_columns, columns)))[:, :-1])
    del rows, blocks  # these fill as much memory as all causes
    parts = {name: every.part(group_of == name) for name in names.tolist()}
    times = dict.fromkeys((cause.name for cause in causes), 0)
    for _ in range(BOUNDS.selection_draws):
        kept = set(rng.choice(names, kept_groups, replace=False).tolist())
        out = [part for name, part in parts.items() if name not in kept]
        # Products of a group are worked out once, however many draws leave it out.
        drawn = every.without(reduce(add, out)) if out else every
        left = np.where(np.isin(group_of, [*kept]), target, 0.0)
        comparison = BesideBase(drawn, known, held, noise).comparison(left)
        found = search(comparison, causes, [begin], most_members=most_members, likely=CLOSE, thorough=not begin)
        for name in found.best.names:
            times[name] += 1
    return {name: count / BOUNDS.selection_draws for name, count in times.items()}


def renumbered(causes: Sequence[Cause]) -> tuple[NDArray[np.int64], list[Cause]]:
    """Return causes' columns, rising, and the causes renumbered."""
    every = [part for c in causes for v in c.variants for part in (v.columns, v.slack, v.whole)]
    wanted = np.unique(np.concatenate(every))

    def placed(columns: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.searchsorted(wanted, columns)

    moved = [
        replace(
            cause,
            variants=tuple(
                replace(v, columns=placed(v.columns), slack=placed(v.slack), whole=placed(v.whole))
                for v in cause.variants
            ),
        )
        for cause in causes
    ]
    return wanted, moved
