"""Linear least squares with random effects in square-root form.

The model is target = J x + noise in blocks of few columns. Orthogonal compression to triangular factors preserves
information and condition. Priors are further rows. [Bierman, Factorization Methods for Discrete Sequential Estimation,
1977, ch. II and V]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from dbbstation.inference.arrow import arrow_of, triangles_without

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.blocks import Block, Columns


ROUNDING = 1e-9
"""Tolerance of rounding: a column known only by its prior is exactly as uncertain as its scale and must not be lost."""


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
class Directions:
    """Directions of scaled fitted columns, most certain first.

    Attributes:
        singular: reciprocal standard deviations, shape (f,).
        vectors: orthonormal rows, shape (f, f).
    """

    singular: Floats
    vectors: Floats


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


def chi2_without(
    blocks: Sequence[Block],
    known: Columns,
    noise: float,
    held: Floats,
    parts: Sequence[Sequence[int]],
) -> list[float]:
    """Return, for each part, the chi-square of priors and blocks outside it."""
    towards = known.scale[~known.random][:, None] * complement(held).T
    found = []
    for root, target, floor in triangles_without(blocks, known, noise, parts):
        seen, _ = np.linalg.qr(root @ towards)
        rest = target - seen @ (seen.T @ target)
        found.append(floor + float(rest @ rest))
    return found


def lost_directions(blocks: Sequence[Block], known: Columns, noise: float) -> Floats:
    """Return orthonormal directions, in scaled columns, with standard deviations above 1."""
    arrow = arrow_of(blocks, known, noise)
    directions = directions_of(arrow.root_of_fitted * known.scale[arrow.fitted])
    return directions.vectors[directions.singular < 1.0 - ROUNDING]


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


def directions_of(seen: Floats) -> Directions:
    """Return directions of a scaled root of information, shape (r, f), most certain first."""
    _, singular, vectors = np.linalg.svd(seen, full_matrices=True)
    padded = np.zeros(seen.shape[1])
    padded[: len(singular)] = singular
    return Directions(padded, vectors)


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
