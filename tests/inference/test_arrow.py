"""Random effects taken out group by group: the same answer as all rows and columns at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.inference import square_root
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.square_root import (
    Columns,
    arrow_of,
    chi2_without,
    compress,
    lost_directions,
    solve,
    spread,
    spread_over,
)

FITTED, MOUNTINGS, OF_EACH = 5, 24, 3
BARS = 2
TOTAL = FITTED + BARS + MOUNTINGS * OF_EACH + 2
"""Columns: fitted, one for each bar, three for each mounting, and two that no run touches."""
NOISE = 0.3


@pytest.fixture
def known(rng):
    prior = np.concatenate([np.full(FITTED, np.inf), rng.uniform(0.5, 2.0, TOTAL - FITTED)])
    prior[2] = 0.7  # a tolerance that is stated
    random = np.arange(TOTAL) >= FITTED
    return Columns(prior, rng.uniform(0.5, 2.0, TOTAL), random)


def measured(rng, *, own_noise=False):
    """Two runs for each mounting, one bar for each half of them; the last run has a noise of its own where that is asked."""
    runs = []
    for mounting in range(MOUNTINGS):
        first = FITTED + BARS + OF_EACH * mounting
        for _ in range(2):
            bar = FITTED + (mounting >= MOUNTINGS // 2)
            columns = np.array([*range(FITTED), bar, *range(first, first + OF_EACH)])
            runs.append((columns, rng.standard_normal((30, len(columns))), rng.standard_normal(30)))
    noises = [NOISE] * (len(runs) - 1) + [0.05 if own_noise else NOISE]
    return runs, noises


def blocks_of(runs, noises):
    made = [compress(*run) for run in runs]
    return [
        type(block)(**{**vars(block), "noise": None if noise == NOISE else noise})
        for block, noise in zip(made, noises, strict=True)
    ]


def dense(runs, noises, known, held):
    """All rows, weighted, with priors as rows, in NumPy's least squares over the directions that are free."""
    wide, target = [], []
    for (columns, jacobian, readings), noise in zip(runs, noises, strict=True):
        rows = np.zeros((len(readings), TOTAL))
        rows[:, columns] = jacobian / noise
        wide.append(rows)
        target.append(readings / noise)
    bounded = np.isfinite(known.prior)
    wide.append(np.eye(TOTAL)[bounded] / known.prior[bounded, None])
    target.append(np.zeros(bounded.sum()))
    A, b = np.vstack(wide), np.concatenate(target)
    fitted = np.diag(known.scale[:FITTED])
    _, _, vt = np.linalg.svd(held)
    free = np.zeros((TOTAL, TOTAL - len(held)))
    free[:FITTED, : FITTED - len(held)] = fitted @ vt[len(held) :].T
    free[FITTED:, FITTED - len(held) :] = np.eye(TOTAL - FITTED)
    y, *_ = np.linalg.lstsq(A @ free, b, rcond=None)
    x, covariance = free @ y, free @ np.linalg.inv((A @ free).T @ (A @ free)) @ free.T
    return x, covariance, float(np.sum((A @ x - b) ** 2)), A


@pytest.mark.parametrize("own_noise", [False, True])
@pytest.mark.parametrize("directions", [0, 1])
def test_the_answer_is_that_of_all_rows_at_once(rng, known, own_noise, directions):
    runs, noises = measured(rng, own_noise=own_noise)
    held = np.linalg.qr(rng.standard_normal((FITTED, 1)))[0].T[:directions]
    blocks = blocks_of(runs, noises)
    assert len(arrow_of(blocks, known, NOISE).groups) == MOUNTINGS
    found = solve(blocks, known, NOISE, held)
    x, covariance, chi2, A = dense(runs, noises, known, held)
    u = np.sqrt(np.diag(covariance))
    assert np.abs(found.x - x).max() < 1e-7 * u.min()
    np.testing.assert_allclose(found.covariance, covariance, atol=1e-9 * u.max() ** 2)
    np.testing.assert_allclose(found.variance, np.diag(covariance), rtol=1e-9)
    factor = rng.uniform(1.0, 3.0, TOTAL)
    wider = found.spreads.times(factor)
    np.testing.assert_allclose(wider.covariance, np.outer(factor, factor) * found.covariance, rtol=1e-12)
    np.testing.assert_allclose(wider.variance, factor**2 * found.variance, rtol=1e-12)
    assert found.chi2 == pytest.approx(chi2, rel=1e-9)
    bounded = np.isfinite(known.prior)
    of_others = [*range(len(A) - bounded.sum() - (30 if own_noise else 0))]
    assert found.freedom_used == pytest.approx(np.trace(A[of_others] @ covariance @ A[of_others].T), rel=1e-8)
    stated = np.setdiff1d(np.arange(len(A)), of_others)
    target = np.concatenate(
        [*(readings / noise for (_, _, readings), noise in zip(runs, noises, strict=True)), np.zeros(bounded.sum())]
    )
    assert found.stated_chi2 == pytest.approx(np.sum((A @ x - target)[stated] ** 2), rel=1e-8)


def test_directions_are_those_of_all_rows_at_once(rng, known, monkeypatch):
    runs, noises = measured(rng)
    runs = [(columns, jacobian.copy(), readings) for columns, jacobian, readings in runs]
    for _, jacobian, _ in runs:
        jacobian[:, 4] = jacobian[:, 3]  # their difference is lost
    blocks = blocks_of(runs, noises)
    by_groups = lost_directions(blocks, known, NOISE)
    monkeypatch.setattr(square_root, "BOUNDS", replace(BOUNDS, group_work=np.inf))
    assert not arrow_of(blocks, known, NOISE).groups
    np.testing.assert_allclose(np.abs(by_groups @ lost_directions(blocks, known, NOISE).T), [[1.0]], atol=1e-9)
    expected = np.zeros(FITTED)
    expected[3:] = 1.0 / known.scale[3], -1.0 / known.scale[4]
    np.testing.assert_allclose(np.abs(by_groups[0] @ expected / np.linalg.norm(expected)), 1.0, atol=1e-9)


@pytest.mark.parametrize("directions", [0, 1])
def test_what_is_left_without_some_runs_is_what_a_fit_without_them_leaves(rng, known, directions):
    runs, noises = measured(rng)
    held = np.linalg.qr(rng.standard_normal((FITTED, 1)))[0].T[:directions]
    parts = [[], [0], [0, 1], [7, 30], [46, 47]]
    found = chi2_without(blocks_of(runs, noises), known, NOISE, held, parts)
    for part, chi2 in zip(parts, found, strict=True):
        kept = [k for k in range(len(runs)) if k not in part]
        assert chi2 == pytest.approx(dense([runs[k] for k in kept], [NOISE] * len(kept), known, held)[2], rel=1e-9)


def test_rows_over_some_columns_are_those_over_all(rng, known):
    blocks = blocks_of(*measured(rng))
    some = rng.permutation(TOTAL)[: TOTAL // 2]
    np.testing.assert_array_equal(spread_over(blocks, some), spread(blocks, TOTAL)[:, [*some, TOTAL]])
    del known


def test_a_group_is_one_mounting_whatever_their_number(rng, known):
    runs, noises = measured(rng)
    groups = arrow_of(blocks_of(runs, noises), known, NOISE).groups
    assert {len(group.columns) for group in groups} == {OF_EACH}
    assert {len(group.border) for group in groups} == {FITTED + 1}
    assert all(len(group.left) <= FITTED + 2 for group in groups)
