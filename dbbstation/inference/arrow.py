"""Eliminate random effects group by group, before shared columns.

Mountings and balls affect few runs, so the normal matrix has arrow form. Each group is reduced to a triangular factor;
the work is linear in groups. [Bjorck, Numerical Methods for Least Squares Problems, 1996, sec. 6.3]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.triangle import triangle_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.blocks import Block, Columns


@dataclass(frozen=True, eq=False)
class Group:
    """Random effects that affect only some blocks, as a triangular factor.

    Attributes:
        columns: of the group, shape (j,).
        border: shared columns, shape (b,).
        inner: triangular factor of the group, shape (j, j).
        across: factor rows over the border, shape (j, b).
        target: factor rows over the target, shape (j,).
        left: remaining information on the border as rows, target last, shape (r, b + 1).
    """

    columns: Integers
    border: Integers
    inner: Floats
    across: Floats
    target: Floats
    left: Floats


@dataclass(frozen=True, eq=False)
class Arrow:
    """Triangular factor of all blocks and priors.

    Attributes:
        alone: random effects outside all blocks, known only by priors, shape (a,).
        root: triangular factor over random, then fitted columns, shape (m + f, m + f).
        floor: irreducible sum of squares.
    """

    groups: tuple[Group, ...]
    alone: Integers
    random: Integers
    fitted: Integers
    root: Floats
    target: Floats
    floor: float

    @property
    def root_of_fitted(self) -> Floats:
        """Return the root of the information on fitted columns, marginalised over random effects, shape (f, f)."""
        return self.root[len(self.random) :, len(self.random) :]


def arrow_of(blocks: Sequence[Block], known: Columns, noise: float) -> Arrow:
    """Eliminate groups, then factor the remaining columns."""
    members, border = _split(blocks, known)
    groups = tuple(_group([blocks[k] for k in places], columns, known, noise) for places, columns in members)
    triangle = triangle_of(np.vstack([border.priors(known), *(border.rows(group) for group in groups)]))
    total = len(border.order)
    return Arrow(
        groups=tuple(group for group in groups if len(group.columns)),
        alone=border.alone,
        random=border.order[: border.random],
        fitted=border.order[border.random :],
        root=triangle[:total, :total],
        target=triangle[:total, -1],
        floor=float(triangle[total, total] ** 2),
    )


def triangles_without(
    blocks: Sequence[Block], known: Columns, noise: float, parts: Sequence[Sequence[int]]
) -> Iterator[tuple[Floats, Floats, float]]:
    """Yield, for each part, the information on fitted columns from blocks outside it.

    Yields:
        Triangular factor, shape (f, f), its target, shape (f,), and the irreducible sum of squares.
    """
    members, border = _split(blocks, known)
    group_of = {place: number for number, (places, _) in enumerate(members) for place in places}

    def left_by(number: int, without: Collection[int]) -> Floats:
        places, columns = members[number]
        kept = [blocks[k] for k in places if k not in without]
        return border.rows(_group(kept, columns, known, noise))

    every = [left_by(number, ()) for number in range(len(members))]
    size = max(int(np.sqrt(len(every))), 1)
    bundles = [triangle_of(np.vstack(every[first : first + size])) for first in range(0, len(every), size)]
    priors, total, first_fitted = border.priors(known), len(border.order), border.random
    for part in parts:
        touched = {group_of[place] for place in part}
        opened = {number // size for number in touched}
        rows = [priors, *(bundle for number, bundle in enumerate(bundles) if number not in opened)]
        beside = [k for number in opened for k in range(number * size, min((number + 1) * size, len(every)))]
        rows += [left_by(k, set(part)) if k in touched else every[k] for k in beside]
        triangle = triangle_of(np.vstack(rows))
        root, target = triangle[first_fitted:total, first_fitted:total], triangle[first_fitted:total, -1]
        yield root, target, float(triangle[total, total] ** 2)


@dataclass(frozen=True, eq=False)
class _Border:
    """Columns shared by groups: random, then fitted.

    Attributes:
        order: shape (m + f,).
        place: index of each column in `order`, shape (k,); -1 for other columns.
    """

    order: Integers
    random: int
    place: Integers
    alone: Integers

    def priors(self, known: Columns) -> Floats:
        """Return prior rows, padded with zeros to a full triangular factor."""
        total = len(self.order)
        bounded = self.order[np.isfinite(known.prior[self.order])]
        rows = np.zeros((len(bounded) + total + 1, total + 1))
        rows[np.arange(len(bounded)), self.place[bounded]] = 1.0 / known.prior[bounded]
        return rows

    def rows(self, group: Group) -> Floats:
        """Return a group's remaining information as rows over these columns, target last."""
        wide = np.zeros((len(group.left), len(self.order) + 1))
        wide[:, self.place[group.border]] = group.left[:, :-1]
        wide[:, -1] = group.left[:, -1]
        return wide


def _split(blocks: Sequence[Block], known: Columns) -> tuple[list[tuple[list[int], Integers]], _Border]:
    touched = np.zeros(len(known.prior), dtype=np.bool_)
    for block in blocks:
        touched[block.columns] = True
    stated = known.random & np.isfinite(known.prior)
    members = _groups(blocks, stated & touched)
    kept = known.random & (touched | ~stated)
    for _, columns in members:
        kept[columns] = False
    random, fitted = np.flatnonzero(kept), np.flatnonzero(~known.random)
    order = np.concatenate([random, fitted])
    place = np.full(len(known.prior), -1)
    place[order] = np.arange(len(order))
    return members, _Border(order, len(random), place, np.flatnonzero(stated & ~touched))


def _group(blocks: Sequence[Block], columns: Integers, known: Columns, noise: float) -> Group:
    border = np.setdiff1d(np.concatenate([columns, *(block.columns for block in blocks)]), columns)
    size, total = len(columns), len(columns) + len(border)
    order = np.concatenate([columns, border])
    sort = np.argsort(order)
    rows = np.zeros((size + sum(len(block.target) for block in blocks), total + 1))
    rows[np.arange(size), np.arange(size)] = 1.0 / known.prior[columns]
    row = size
    for block in blocks:
        part = rows[row : row + len(block.target)]
        part[:, sort[np.searchsorted(order, block.columns, sorter=sort)]] = block.triangle
        part[:, -1] = block.target
        part /= noise if block.noise is None else block.noise
        row += len(part)
    triangle = triangle_of(rows) if size or len(rows) > total + 1 else rows
    top = triangle[:size]
    return Group(columns, border, top[:, :size], top[:, size:-1], top[:, -1], triangle[size:, size:])


def _groups(blocks: Sequence[Block], random: Flags) -> list[tuple[list[int], Integers]]:
    """Return blocks and random effects of each group."""
    # An effect in many blocks, such as a bar, would join all groups. The limit of blocks per effect minimises the work,
    # rows times squared columns.
    total, count = len(random), sum(len(block.target) for block in blocks)
    together = [(list(range(len(blocks))), np.zeros(0, dtype=np.int64))]
    if len(blocks) < 2 or not random.any() or count * np.count_nonzero(random) ** 2 < BOUNDS.group_work:  # noqa: PLR2004 - a pair
        return together
    which = np.repeat(np.arange(len(blocks)), [len(block.columns) for block in blocks])
    touched = np.concatenate([block.columns for block in blocks])
    lengths = np.array([len(block.target) for block in blocks])
    times = np.bincount(touched, minlength=total)
    best, least = together, float(count) * total**2
    for most in np.unique(times[random]):
        own = random & (times <= most)
        found = _tied(blocks, which, touched, own)
        shared = total - np.count_nonzero(own)
        work = float(shared) ** 3
        for places, columns in found:
            width = len(columns) + len(np.unique(np.concatenate([blocks[k].columns for k in places]))) if places else 1
            rows = int(lengths[places].sum()) + len(columns)
            work += float(rows) * width**2 + float(min(rows, width)) * shared**2
        if work < least:
            best, least = found, work
    return best


def _tied(blocks: Sequence[Block], which: Integers, touched: Integers, own: Flags) -> list[tuple[list[int], Integers]]:
    number, total = len(blocks), len(own)
    touches = own[touched]
    edges = (np.ones(int(touches.sum())), (which[touches], number + touched[touches]))
    _, label = connected_components(coo_array(edges, shape=(number + total, number + total)), directed=False)
    columns_of: dict[int, list[int]] = {}
    for column in np.flatnonzero(own):
        columns_of.setdefault(int(label[number + column]), []).append(int(column))
    blocks_of: dict[int, list[int]] = {}
    for k in range(number):
        blocks_of.setdefault(int(label[k]), []).append(k)
    return [
        (blocks_of.get(key, []), np.array(columns_of.get(key, []), dtype=np.int64))
        for key in dict.fromkeys([*blocks_of, *columns_of])
    ]
