"""Linear least squares with random effects in square-root form.

The model is target = J x + noise in blocks of few columns. Orthogonal compression to triangular factors preserves
information and condition. Priors are further rows. [Bierman, Factorization Methods for Discrete Sequential Estimation,
1977, ch. II and V]

Mountings and balls affect few runs, so the normal matrix has arrow form. Each group is reduced to a triangular factor
before shared columns; the work is linear in groups. [Bjorck, Numerical Methods for Least Squares Problems, 1996, sec.
6.3]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dbbstation.computing.grouped import grouped
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.triangle import ROUNDING, triangle_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

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


def chi2_without(
    blocks: Sequence[Block],
    known: Columns,
    noise: float,
    held: Floats,
    parts: Sequence[Sequence[int]],
) -> list[float]:
    """Return, for each part, the chi-square of priors and blocks outside it."""
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
    towards, found = known.scale[~known.random][:, None] * complement(held).T, []
    for part in parts:
        touched = {group_of[place] for place in part}
        opened = {number // size for number in touched}
        rows = [priors, *(bundle for number, bundle in enumerate(bundles) if number not in opened)]
        beside = [k for number in opened for k in range(number * size, min((number + 1) * size, len(every)))]
        rows += [left_by(k, set(part)) if k in touched else every[k] for k in beside]
        triangle = triangle_of(np.vstack(rows))
        target = triangle[first_fitted:total, -1]
        seen, _ = np.linalg.qr(triangle[first_fitted:total, first_fitted:total] @ towards)
        rest = target - seen @ (seen.T @ target)
        found.append(float(triangle[total, total] ** 2) + float(rest @ rest))
    return found


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
    columns_of = grouped((int(label[number + column]), int(column)) for column in np.flatnonzero(own))
    blocks_of = grouped((int(label[k]), k) for k in range(number))
    return [
        (blocks_of.get(key, []), np.array(columns_of.get(key, []), dtype=np.int64))
        for key in dict.fromkeys([*blocks_of, *columns_of])
    ]


@dataclass(frozen=True, eq=False)
class Spreads:
    """A covariance as the sum of a shared root and roots of groups of random effects.

    Attributes:
        shared: root, shape (k, q).
        own: columns, shape (j,), and root, shape (j, j), per group.
    """

    shared: Floats
    own: tuple[tuple[Integers, Floats], ...]
    alone: Integers
    prior: Floats

    @cached_property
    def variance(self) -> Floats:
        """Return each column's variance, shape (k,)."""
        variance = np.einsum("kq,kq->k", self.shared, self.shared)
        variance[self.alone] = self.prior**2
        for columns, root in self.own:
            variance[columns] += np.einsum("ij,ij->i", root, root)
        return variance

    @cached_property
    def covariance(self) -> Floats:
        """Return the covariance, shape (k, k)."""
        covariance: Floats = self.shared @ self.shared.T
        covariance[self.alone, self.alone] = self.prior**2
        for columns, root in self.own:
            covariance[np.ix_(columns, columns)] += root @ root.T
        return covariance

    def times(self, factor: Floats) -> Spreads:
        """Return the covariance with standard deviations scaled by factors, shape (k,)."""
        return Spreads(
            factor[:, None] * self.shared,
            tuple((columns, factor[columns, None] * root) for columns, root in self.own),
            self.alone,
            factor[self.alone] * self.prior,
        )

    def square_of(self, columns: Integers, rows: Floats) -> float:
        """Return the trace of R C R^T for rows R, shape (r, j), and covariance C."""
        square = float(np.sum((rows @ self.shared[columns]) ** 2))
        for group, root in self.own:
            _, place, within = np.intersect1d(columns, group, assume_unique=True, return_indices=True)
            if len(place):
                square += float(np.sum((rows[:, place] @ root[within]) ** 2))
        return square


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of `solve`.

    Attributes:
        held: directions held at zero, in scaled columns, shape (h, f).
        stated_chi2: part of `chi2` from priors and blocks with separate noise.
        freedom_used: degrees of freedom of measurements with the channel's noise.
    """

    x: Floats
    spreads: Spreads
    held: Floats
    chi2: float
    stated_chi2: float
    freedom_used: float

    @property
    def variance(self) -> Floats:
        """Return variances, shape (k,), without the full covariance."""
        return self.spreads.variance

    @property
    def covariance(self) -> Floats:
        """Return the covariance, shape (k, k), zero along held directions."""
        return self.spreads.covariance


def solve(
    blocks: Sequence[Block],
    known: Columns,
    noise: float,
    held: Floats | None = None,
) -> Solution:
    """Return estimates of fitted columns and predictions of random columns.

    Args:
        held: directions held at zero, in scaled columns, shape (h, f).
    """
    arrow = arrow_of(blocks, known, noise)
    random, fitted = arrow.random, arrow.fitted
    root, target, m = arrow.root, arrow.target, len(arrow.random)
    inner, cross = root[:m, :m], root[:m, m:]
    scale = known.scale[fitted]
    seen = root[m:, m:] * scale
    held = np.zeros((0, len(fitted))) if held is None else held
    free = complement(held)
    u, s, vt = np.linalg.svd(seen @ free.T, full_matrices=False)
    towards = free.T @ vt.T
    x = np.zeros(len(known.prior))
    x[fitted] = scale * (towards @ ((u.T @ target[m:]) / s))
    x[random] = solve_triangular(inner, target[:m] - cross @ x[fitted]) if m else x[random]
    spread = scale[:, None] * towards / s
    inner_inverse = solve_triangular(inner, np.eye(m)) if m else np.zeros((0, 0))
    shared = np.zeros((len(known.prior), m + len(s)))
    shared[random, :m] = inner_inverse
    shared[random, m:] = -inner_inverse @ (cross @ spread)
    shared[fitted, m:] = spread
    own = []
    for one in arrow.groups:
        back = solve_triangular(
            one.inner, np.column_stack([one.target, one.across @ x[one.border], one.across @ shared[one.border]])
        )
        x[one.columns] = back[:, 0] - back[:, 1]
        shared[one.columns] = -back[:, 2:]
        own.append((one.columns, solve_triangular(one.inner, np.eye(len(one.columns)))))
    spreads = Spreads(shared, tuple(own), arrow.alone, known.prior[arrow.alone])
    remaining = target - root @ np.concatenate([x[random], x[fitted]])
    with_prior = np.isfinite(known.prior)
    stated_chi2 = float(np.sum((x[with_prior] / known.prior[with_prior]) ** 2))
    used = float(np.count_nonzero(known.random) + len(s))
    used -= float(np.sum(spreads.variance[with_prior] / known.prior[with_prior] ** 2))
    for block in blocks:
        if block.noise is not None:
            rows = block.triangle / block.noise
            stated_chi2 += float(np.sum((rows @ x[block.columns] - block.target / block.noise) ** 2))
            used -= spreads.square_of(block.columns, rows)
    return Solution(
        x=x,
        spreads=spreads,
        held=held,
        chi2=arrow.floor + float(remaining @ remaining),
        stated_chi2=stated_chi2,
        freedom_used=used,
    )


def lost_directions(blocks: Sequence[Block], known: Columns, noise: float) -> Floats:
    """Return orthonormal directions, in scaled columns, with standard deviations above 1."""
    arrow = arrow_of(blocks, known, noise)
    _, singular, vectors = np.linalg.svd(arrow.root_of_fitted * known.scale[arrow.fitted])
    return vectors[singular < 1.0 - ROUNDING]


def unseen_combinations(blocks: Sequence[Block], known: Columns, noise: float, held: Floats) -> Floats:
    """Return combinations that blocks do not determine, in units of the scales, shape (h, k)."""
    # Directions lost at the first linearisation change until the solution, so other columns are adjusted by least
    # squares. Combinations are orthonormal in scaled columns, with zero random effects.
    combinations = np.zeros((len(held), len(known.prior)))
    if len(held):
        arrow = arrow_of(blocks, known, noise)
        fitted = arrow.fitted
        seen, free = arrow.root_of_fitted * known.scale[fitted], complement(held)
        follow, *_ = np.linalg.lstsq(seen @ free.T, -seen @ held.T, rcond=None)
        orthonormal, _ = np.linalg.qr(held.T + free.T @ follow)
        combinations[:, fitted] = orthonormal.T * known.scale[fitted]
    return combinations


def complement(rows: Floats) -> Floats:
    """Return orthonormal rows orthogonal to these."""
    if len(rows) == 0:
        return np.eye(rows.shape[1])
    _, _, vt = np.linalg.svd(rows, full_matrices=True)
    return vt[len(rows) :]


def free_directions(base: Columns, fitted: Integers, held: Floats) -> Floats:
    """Return free directions of scaled columns, times their scales, shape (f, free)."""
    if len(held) == 0:
        return np.diag(base.scale[fitted])
    return base.scale[fitted][:, None] * complement(held).T
