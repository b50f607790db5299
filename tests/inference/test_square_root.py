"""The square-root solver against dense textbook formulas and simulated coverage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.inference.harmonics import noise_of
from dbbstation.inference.square_root import Columns, compress, lost_directions, solve, spread, unseen_combinations

NOISE = 0.3


@pytest.fixture
def problem(rng):
    """Five runs of 40 samples; three fitted columns, and one random effect per run."""
    runs, fitted = 5, 3
    jacobians = [np.column_stack([rng.normal(size=(40, fitted)), np.ones(40)]) for _ in range(runs)]
    columns = [np.array([0, 1, 2, 3 + k]) for k in range(runs)]
    known = Columns(
        prior=np.array([np.inf] * fitted + [0.8] * runs),
        scale=np.ones(fitted + runs),
        random=np.array([False] * fitted + [True] * runs),
    )
    x = np.concatenate([[1.0, -2.0, 0.5], rng.normal(0, 0.8, runs)])
    targets = [j @ x[c] + rng.normal(0, NOISE, 40) for j, c in zip(jacobians, columns, strict=True)]
    return jacobians, columns, targets, known, x


def blocks_of(jacobians, columns, targets):
    return [compress(c, j, t) for j, c, t in zip(jacobians, columns, targets, strict=True)]


def dense(jacobians, columns, targets, known):
    """Henderson's mixed-model equations, written out."""
    k = len(known.prior)
    a = np.zeros((k, k))
    b = np.zeros(k)
    for j, c, t in zip(jacobians, columns, targets, strict=True):
        wide = np.zeros((len(t), k))
        wide[:, c] = j
        a += wide.T @ wide / NOISE**2
        b += wide.T @ t / NOISE**2
    a += np.diag(np.where(np.isfinite(known.prior), 1.0 / known.prior**2, 0.0))
    return np.linalg.solve(a, b), np.linalg.inv(a)


def test_estimates_and_covariance_are_those_of_the_mixed_model_equations(problem):
    jacobians, columns, targets, known, _ = problem
    solution = solve(blocks_of(jacobians, columns, targets), known, NOISE)
    x, covariance = dense(jacobians, columns, targets, known)
    assert np.allclose(solution.x, x, atol=1e-12)
    assert np.allclose(solution.covariance, covariance, atol=1e-14)


def test_fitted_columns_are_generalised_least_squares_over_the_random_ones(problem):
    jacobians, columns, targets, known, _ = problem
    solution = solve(blocks_of(jacobians, columns, targets), known, NOISE)
    a, b = np.zeros((3, 3)), np.zeros(3)
    for j, t in zip(jacobians, targets, strict=True):
        weight = np.linalg.inv(NOISE**2 * np.eye(40) + 0.8**2 * np.ones((40, 40)))
        a += j[:, :3].T @ weight @ j[:, :3]
        b += j[:, :3].T @ weight @ t
    assert np.allclose(solution.x[:3], np.linalg.solve(a, b), atol=1e-11)
    assert np.allclose(solution.covariance[:3, :3], np.linalg.inv(a), atol=1e-13)


def test_chi2_and_freedom(problem):
    jacobians, columns, targets, known, _ = problem
    solution = solve(blocks_of(jacobians, columns, targets), known, NOISE)
    residual = np.concatenate([t - j @ solution.x[c] for j, c, t in zip(jacobians, columns, targets, strict=True)])
    prior = np.sum((solution.x[3:] / 0.8) ** 2)
    assert solution.stated_chi2 == pytest.approx(prior)
    assert solution.chi2 == pytest.approx(residual @ residual / NOISE**2 + prior)
    hat = sum(np.trace(j @ solution.covariance[np.ix_(c, c)] @ j.T) for j, c in zip(jacobians, columns, strict=True))
    assert solution.freedom_used == pytest.approx(hat / NOISE**2)


def test_readings_of_another_instrument_count_with_their_own_noise(problem, rng):
    jacobians, columns, targets, known, _ = problem
    other, own = rng.normal(size=(4, 3)), 0.02
    read = rng.normal(size=4)
    block = replace(compress(np.arange(3), other, read), noise=own)
    blocks = [*blocks_of(jacobians, columns, targets), block]
    solution = solve(blocks, known, NOISE)
    scaled = [*jacobians, other * NOISE / own]
    x, covariance = dense(scaled, [*columns, np.arange(3)], [*targets, read * NOISE / own], known)
    assert np.allclose(solution.x, x, atol=1e-12)
    assert np.allclose(solution.covariance, covariance, atol=1e-14)
    left = (read - other @ solution.x[:3]) / own
    prior = np.sum((solution.x[3:] / 0.8) ** 2)
    assert solution.stated_chi2 == pytest.approx(left @ left + prior)
    hat = sum(np.trace(j @ covariance[np.ix_(c, c)] @ j.T) for j, c in zip(jacobians, columns, strict=True))
    assert solution.freedom_used == pytest.approx(hat / NOISE**2)


def test_a_direction_that_no_run_sees_is_lost_and_held(rng):
    seen = rng.normal(size=(60, 1))
    block = compress(np.array([0, 1]), np.hstack([seen, -seen]), seen[:, 0] * 2.0)
    known = Columns(np.full(2, np.inf), np.ones(2), np.zeros(2, dtype=bool))
    held = lost_directions([block], known, NOISE)
    assert np.allclose(np.abs(held), np.full((1, 2), np.sqrt(0.5)))
    solution = solve([block], known, NOISE, held)
    assert np.allclose(solution.x, [1.0, -1.0])
    assert np.allclose(solution.covariance @ held[0], 0.0)


def test_lost_means_less_known_than_it_matters():
    """One measurement of a column with sensitivity 0.01 leaves it uncertain by 100 noises."""
    block = compress(np.array([0]), np.array([[0.01]]), np.array([0.0]))

    def lost(scale):
        known = Columns(np.array([np.inf]), np.array([scale]), np.array([False]))
        return len(lost_directions([block], known, NOISE))

    assert lost(100 * NOISE * 0.99) == 1
    assert lost(100 * NOISE * 1.01) == 0


def test_a_wide_block_with_fewer_samples_than_columns_loses_nothing(rng):
    jacobian, target = rng.normal(size=(2, 5)), rng.normal(size=2)
    block = compress(np.arange(5), jacobian, target)
    assert np.allclose(block.triangle.T @ block.triangle, jacobian.T @ jacobian)
    assert np.allclose(block.triangle.T @ block.target, jacobian.T @ target)


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.9])
def test_noise_of_a_first_order_process(rng, phi):
    """Its integrated autocorrelation is (1 + phi) / (1 - phi), its variance 1 / (1 - phi^2)."""
    runs = []
    for _ in range(30):
        white = rng.normal(size=3000)
        series = np.zeros(3000)
        series[0] = white[0] / np.sqrt(1 - phi**2)
        for k in range(1, 3000):
            series[k] = phi * series[k - 1] + white[k]
        runs.append(series)
    noise = noise_of(runs, 0.0)
    assert noise.sigma == pytest.approx(1 / np.sqrt(1 - phi**2), rel=0.05)
    assert noise.correlation_samples == pytest.approx((1 + phi) / (1 - phi), rel=0.15)


def test_long_runs_are_compressed_slab_by_slab_to_the_same_triangle(rng):
    jacobian, target = rng.normal(size=(5000, 7)), rng.normal(size=5000)
    jacobian[:, 6] = jacobian[:, 5] + 1e-9 * rng.normal(size=5000)  # a condition that squaring would lose
    block = compress(np.arange(7), jacobian, target)
    whole = np.linalg.qr(np.column_stack([jacobian, target]), mode="r")
    assert np.allclose(np.abs(block.triangle), np.abs(whole[:, :-1]), atol=1e-12)
    assert abs(block.triangle[6, 6]) == pytest.approx(1e-9 * np.sqrt(5000), rel=0.1)
    assert np.allclose(np.abs(block.target), np.abs(whole[:, -1]), atol=1e-5)  # that is how well 1e-9 is a number


@pytest.mark.parametrize("count", [3, 20, 4000])
def test_what_is_no_number_is_refused(rng, count):
    jacobian, target = rng.normal(size=(count, 2)), np.zeros(count)
    jacobian[count // 2, 0] = np.nan
    with pytest.raises(ValueError, match="must be numbers"):
        compress(np.arange(2), jacobian, target)


def test_blocks_spread_over_all_columns_say_the_same(problem):
    jacobians, columns, targets, known, _ = problem
    blocks = blocks_of(jacobians, columns, targets)
    blocks[2] = replace(blocks[2], noise=0.05)
    size = len(known.prior)
    wide = spread(blocks, size)
    expected = np.zeros((size + 1, size + 1))
    for jacobian, at, target in zip(jacobians, columns, targets, strict=True):
        whole = np.zeros((len(target), size + 1))
        whole[:, at], whole[:, -1] = jacobian, target
        expected += whole.T @ whole
    np.testing.assert_allclose(wide.T @ wide, expected, rtol=1e-10, atol=1e-10)
    assert spread([], size).shape == (0, size + 1)


@pytest.mark.parametrize("held", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.8, -0.6, 0.0]])
def test_what_is_unseen_is_the_same_whatever_is_held_in_its_place(problem, held):
    """The second column is three times the first: only their sum 1 : 3 is seen, and 3 : -1 is not, whatever is held."""
    jacobians, columns, targets, known, _ = problem
    for j in jacobians:
        j[:, 1] = 3.0 * j[:, 0]
    known = replace(known, scale=np.r_[2.0, 0.5, 1.0, known.scale[3:]])
    found = unseen_combinations(blocks_of(jacobians, columns, targets), known, NOISE, np.array([held]))
    # As large as a prior of the scales allows along it: a size s with (3 s / 2)² + (s / 0.5)² = 1.
    size = 1.0 / np.hypot(3.0 / 2.0, 1.0 / 0.5)
    expected = np.zeros(8)
    expected[:2] = [3.0 * size, -size]
    assert np.allclose(found * np.sign(found[0, 0]), expected, atol=1e-9)


def test_nothing_is_unseen_where_nothing_is_held(problem):
    jacobians, columns, targets, known, _ = problem
    found = unseen_combinations(blocks_of(jacobians, columns, targets), known, NOISE, np.zeros((0, 3)))
    assert found.shape == (0, 8)
