"""How a difference between sessions is ordered: how much of it follows each of many variables, and beyond which chance.

No physics is named. A variable is a family of columns: what readings do if something changes with the variable alone.
Differences that follow no variable are no noise either: they are smooth, and both directions of a test resemble each
other. What is by chance is therefore read, harmonic by harmonic, from what the family leaves, separately for what both
directions share and for what changes its sign with the direction; noise and the stated scatter are the least.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from dbbstation.diagnosis.compare_noise import Weighting, stated_variance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare_families import Family
    from dbbstation.diagnosis.compare_noise import Chance
    from dbbstation.diagnosis.compare_pairs import Pair

ONLY_NOISE = 0.1
"""Probability above which what a family leaves in a harmonic counts as noise, whose size is known far better."""

NEIGHBOURS = 5
"""A harmonic of which a family leaves nothing to judge by is judged by those up to so many away."""

MOST_COLUMNS = 2
"""Columns per test that a variable may have: a curve with more of them fits whatever few circles do."""

RANK = 1e-8


@dataclass(frozen=True, eq=False)
class Organised:
    """What one variable explains.

    Attributes:
        variable: as printed.
        strut: 1 to 6; None where it is not one strut's.
        share: of the sum of squares beyond chance, every harmonic by the measure of its own chance, less what as many
            columns explain by chance; 0 to 1.
        plain_share: the same of the sum of squares as it is, in mm²: balls that sit anew count in full.
        columns: freedom that the variable has.
        probability: of explaining as much by chance, times the number of variables tried.
        worth: information criterion, less is better [Schwarz 1978].
        amplitudes: name, value, standard deviation, unit; empty where the columns mean nothing one by one.
        family: its columns.
    """

    variable: str
    strut: int | None
    share: float
    plain_share: float
    columns: int
    probability: float
    worth: float
    amplitudes: tuple[tuple[str, float, float, str], ...]
    family: Family


@dataclass(frozen=True)
class Halves:
    """Tests that were run in both directions: half sum and half difference.

    Attributes:
        same_mm: root mean square of what both directions share, beyond noise and what is stated [mm].
        opposite_mm: of what changes its sign with the direction [mm].
        opposite_probability: of the latter by chance alone.
    """

    same_mm: float
    opposite_mm: float
    opposite_probability: float


@dataclass(frozen=True, eq=False)
class _Turned:
    """Differences of both directions as sum and difference, over the root of two: orthogonal, nothing is lost.

    Attributes:
        turn: rows of the new order by runs, shape (r, r).
        kind: 0 for sums, 1 for differences, 2 for runs in one direction only, shape (r,).
        values: coefficients, shape (r, k).
        noise: variance, shape (r, k).
        stated: shape (r, m, q).
    """

    turn: NDArray[np.float64]
    kind: NDArray[np.int64]
    values: NDArray[np.float64]
    noise: NDArray[np.float64]
    stated: NDArray[np.float64]

    @property
    def stated_variance(self) -> NDArray[np.float64]:
        """Variance of each value by what is stated, shape (r, k)."""
        return stated_variance((self.noise.shape[1] - 1) // 2, self.noise, self.stated)


def organise(
    pairs: Sequence[Pair], chance: Chance, every: Sequence[Family], taken: Sequence[Organised] = ()
) -> list[Organised]:
    """What each variable explains beside those that were taken, best first.

    Args:
        pairs: runs.
        chance: their differences and what chance puts there.
        every: variables.
        taken: variables whose columns are fitted along.
    """
    turned = _turned(pairs, chance)
    held = np.concatenate([np.zeros((*chance.coefficients.shape, 0)), *(one.family.columns for one in taken)], axis=2)
    tried = [family for family in every if all(family.name != one.family.name for one in taken)]
    least = Weighting.of(chance.low, turned.noise, turned.stated)
    places = {(pair.a[0].setup.mounting, pair.b[0].setup.mounting) for pair in pairs}
    most = MOST_COLUMNS * max(len(places), len({pair.test for pair in pairs}))
    found = [_explained(family, held, turned, least, chance, len(tried)) for family in tried]
    return sorted((one for one in found if one is not None and one.columns <= most), key=lambda one: one.worth)


def halves(pairs: Sequence[Pair], chance: Chance) -> Halves | None:
    """What both directions share, and what changes its sign; None where no test was run in both."""
    turned = _turned(pairs, chance)
    sums, differences = turned.kind == 0, turned.kind == 1
    if not sums.any():
        return None
    # A sum over the root of two has the sum of squares that the half sum has in both runs; so has the difference.
    samples = 2.0 * float(sums.sum()) * len(pairs[0].a_mm)
    same, opposite = (Weighting.of(chance.low, turned.noise[rows], turned.stated[rows]) for rows in (sums, differences))
    square = float(np.sum(opposite.whitened(turned.values[differences][:, :, None]) ** 2))
    count = float(turned.values[differences].size)
    return Halves(
        same_mm=float(np.sqrt(same.beyond(turned.values[sums]) / samples)),
        opposite_mm=float(np.sqrt(opposite.beyond(turned.values[differences]) / samples)),
        opposite_probability=float(f_distribution.sf(square / count, count, chance.freedom)),
    )


def _turned(pairs: Sequence[Pair], chance: Chance) -> _Turned:
    turn = np.eye(len(pairs))
    kind = np.full(len(pairs), 2, dtype=np.int64)
    by_test: dict[tuple[str, int], list[int]] = {}
    for r, pair in enumerate(pairs):
        by_test.setdefault((pair.test, pair.number), []).append(r)
    for rows in by_test.values():
        if len(rows) == 2:  # noqa: PLR2004 - both directions
            turn[np.ix_(rows, rows)] = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)
            kind[rows] = [0, 1]
    return _Turned(
        turn,
        kind,
        turn @ chance.coefficients,
        turn**2 @ chance.noise,
        np.einsum("sr,rcq->scq", turn, chance.stated),
    )


def _explained(
    family: Family, held: NDArray[np.float64], turned: _Turned, least: Weighting, chance: Chance, tried: int
) -> Organised | None:
    """What a family explains beside columns that are held; None where it has none of its own."""
    columns = np.einsum("sr,rkp->skp", turned.turn, np.concatenate([held, family.columns], axis=2))
    values, skip = turned.values[:, :, None], held.shape[2]
    variance = turned.noise
    # Twice: first what is left under noise alone, then under the chance that this left.
    for _ in range(2):
        weighting = Weighting.of(chance.low, variance, turned.stated)
        fit = _Fit.of(weighting.whitened(columns), weighting.whitened(values)[:, 0], skip)
        if fit is None:
            return None
        left = (values[:, :, 0] - columns @ fit.amplitudes).reshape(variance.shape)
        variance, freedom = _by_chance(left, fit.leverage.reshape(variance.shape), turned, chance, least)
    weighting = Weighting.of(chance.low, variance, turned.stated)
    fit = _Fit.of(weighting.whitened(columns), weighting.whitened(values)[:, 0], skip)
    if fit is None:
        return None
    weights = fit.own**2 / max(float(np.sum(fit.own**2)), 1e-300)
    sizes = np.bincount(freedom.cell.ravel(), weights, minlength=len(freedom.of_cell))
    known = 1.0 / max(float(np.sum(sizes**2 / freedom.of_cell)), 1e-12)
    probability = float(f_distribution.sf(float(np.sum(fit.own**2)) / fit.rank, fit.rank, known))
    scatter = turned.stated_variance
    excess = (variance + scatter) / (turned.noise + scatter)
    share, worth = _share_and_worth(least, columns, values, skip, excess)
    return Organised(
        variable=family.variable,
        strut=family.strut,
        share=share,
        plain_share=_plain_share(columns, turned, variance + scatter, skip),
        columns=fit.rank,
        probability=min(1.0, probability * tried),
        worth=worth,
        amplitudes=_amplitudes(family, fit, skip),
        family=family,
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Whitened least squares of columns, of which the first are held.

    Attributes:
        amplitudes: of all columns, shape (p,); the shortest where columns say the same.
        sigma: their standard deviations; infinite where the runs cannot tell.
        own: what the columns that are not held explain beside the others, shape (n,).
        leverage: of every value, shape (n,).
        rank: freedom of the columns that are not held.
    """

    amplitudes: NDArray[np.float64]
    sigma: NDArray[np.float64]
    own: NDArray[np.float64]
    leverage: NDArray[np.float64]
    rank: int

    @classmethod
    def of(cls, columns: NDArray[np.float64], values: NDArray[np.float64], skip: int) -> _Fit | None:
        """Fit; None where the columns that are not held span nothing of their own."""
        first = _span(columns[:, :skip])
        rest = columns[:, skip:] - first @ (first.T @ columns[:, skip:])
        size = np.linalg.norm(columns[:, skip:], axis=0)
        rest = rest[:, np.linalg.norm(rest, axis=0) > RANK * size]
        second = _span(rest)
        if second.shape[1] == 0:
            return None
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        u, s, vt = np.linalg.svd(columns / scale, full_matrices=False)
        seen = s > RANK * s[0]
        amplitudes = (vt[seen].T @ ((u[:, seen].T @ values) / s[seen])) / scale
        blind = np.sum(vt[~seen] ** 2, axis=0) > RANK
        sigma = np.where(blind, np.inf, np.sqrt(np.sum((vt[seen] / s[seen, None]) ** 2, axis=0)) / scale)
        own = second @ (second.T @ values)
        leverage = np.sum(first**2, axis=1) + np.sum(second**2, axis=1)
        return cls(amplitudes, sigma, own, leverage, second.shape[1])


def _span(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal columns that span the same."""
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > 0.0] / size[size > 0.0]
    if kept.shape[1] == 0:
        return kept
    q, r, _ = qr(kept, mode="economic", pivoting=True)
    return np.asarray(q[:, np.abs(np.diag(r)) > RANK], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Freedom:
    """How well chance is known: cell of each value, shape (r, k), and degrees of freedom of each cell."""

    cell: NDArray[np.int64]
    of_cell: NDArray[np.float64]


def _by_chance(
    left: NDArray[np.float64], leverage: NDArray[np.float64], turned: _Turned, chance: Chance, least: Weighting
) -> tuple[NDArray[np.float64], _Freedom]:
    """Variance of every value by chance, from what a fit left, kind by kind and harmonic by harmonic, shape (r, k)."""
    stride = chance.low + 1
    cell = turned.kind[:, None] * stride + chance.harmonic[None, :]

    def summed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.bincount(cell.ravel(), values.ravel(), minlength=3 * stride).astype(np.float64)

    number = summed(np.ones_like(left))
    count = number - summed(np.minimum(leverage, 1.0))
    square = summed(least.whitened(left[:, :, None]).reshape(left.shape) ** 2)
    # Independent scatter of variance v on top adds v times the precision to the expected square.
    per_variance = summed(least.precision) * count / np.maximum(number, 1.0)
    more, known = np.zeros(3 * stride), np.full(3 * stride, chance.freedom)
    for k in np.unique(cell):
        near = [k]
        if count[k] < 1.0:  # the family takes all of it
            begin = k // stride * stride
            near = [j for j in range(begin, begin + stride) if 0 < abs(j - k) <= NEIGHBOURS]
        freedom, found = float(count[near].sum()), float(square[near].sum())
        if freedom >= 1.0 and chi2.sf(found, freedom) < ONLY_NOISE:
            more[k], known[k] = (found - freedom) / float(per_variance[near].sum()), freedom
    return turned.noise + more[cell], _Freedom(cell, known)


def _share_and_worth(
    least: Weighting, columns: NDArray[np.float64], values: NDArray[np.float64], skip: int, excess: NDArray[np.float64]
) -> tuple[float, float]:
    """Share of what is beyond chance that columns explain, and information criterion [Schwarz 1978].

    Both with every value in units of what noise and stated scatter put there: a ball that sat two micrometres off its
    place must not drown a change that lies far above the noise of the harmonics beside it.

    Args:
        least: by noise and what is stated.
        columns: held and own, shape (r, k, p).
        values: shape (r, k, 1).
        skip: how many are held.
        excess: variance of what the family leaves in these units, shape (r, k): as many columns explain so much of it.
    """
    target, white = least.whitened(values)[:, 0], least.whitened(columns)
    held, both = _span(white[:, :skip]), _span(white)
    total = float(target @ target)
    own = float(np.sum((both.T @ target) ** 2) - np.sum((held.T @ target) ** 2))
    chance = float((np.sum(both**2, axis=1) - np.sum(held**2, axis=1)) @ excess.ravel())
    share = (own - chance) / max(total - len(target), 1e-300)
    left = total - float(np.sum((both.T @ target) ** 2))
    worth = len(target) * float(np.log(max(left, 1e-300))) + both.shape[1] * float(np.log(len(target)))
    return float(np.clip(share, 0.0, 1.0)), worth


def _plain_share(columns: NDArray[np.float64], turned: _Turned, variance: NDArray[np.float64], skip: int) -> float:
    """Share of the sum of squares beyond noise that columns explain in least squares without weights."""
    flat, values = columns.reshape(-1, columns.shape[2]), turned.values.ravel()
    held, both = _span(flat[:, :skip]), _span(flat)
    own = float(np.sum((both.T @ values) ** 2) - np.sum((held.T @ values) ** 2))
    chance = float((np.sum(both**2, axis=1) - np.sum(held**2, axis=1)) @ variance.ravel())
    whole = float(values @ values) - float(turned.noise.sum())
    return float(np.clip((own - chance) / max(whole, 1e-300), 0.0, 1.0))


def _amplitudes(family: Family, fit: _Fit, skip: int) -> tuple[tuple[str, float, float, str], ...]:
    return tuple(
        (name, float(fit.amplitudes[skip + p]) * factor, float(fit.sigma[skip + p]) * factor, unit)
        for p, (name, factor, unit) in enumerate(family.amplitudes)
    )
