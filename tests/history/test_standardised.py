"""Values held against those before them: independent standard normal numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from dbbstation.history.standardised import ScatterRatio, standardised


def one_by_one(values, u, k):
    """The statistic of one value, written out: weighted mean and scatter of those before, Student's t, normal quantile."""
    before, weight = values[:k], 1.0 / u[:k] ** 2
    mean = np.sum(weight * before) / np.sum(weight)
    scatter = np.sqrt(np.sum(weight * (before - mean) ** 2) / (k - 1))
    ratio = (values[k] - mean) / (scatter * np.sqrt(u[k] ** 2 + 1.0 / np.sum(weight)))
    return stats.norm.ppf(stats.t.cdf(ratio, k - 1))


def test_each_value_is_held_against_the_weighted_mean_and_scatter_before_it(rng):
    u = rng.uniform(0.3, 2.0, 25)
    values = 7.0 + u * rng.standard_normal(25)
    found = standardised(values, u, 5)
    z = found.z
    assert np.isnan(z[0])
    assert found.by_stated.tolist() == [False] + [True] * 4 + [False] * 20
    before = [np.average(values[:k], weights=1.0 / u[:k] ** 2) for k in range(1, 5)]
    u_before = [1.0 / np.sqrt(np.sum(1.0 / u[:k] ** 2)) for k in range(1, 5)]
    assert z[1:5] == pytest.approx((values[1:5] - before) / np.hypot(u[1:5], u_before))
    assert z[5:] == pytest.approx([one_by_one(values, u, k) for k in range(5, 25)], rel=1e-9)


@pytest.mark.parametrize("scatter", [0.2, 1.0, 5.0])
def test_they_are_standard_normal_and_independent_whatever_the_scatter(rng, scatter):
    u = rng.uniform(0.5, 2.0, (2_000, 20))
    values = 3.0 + scatter * u * rng.standard_normal(u.shape)
    z = np.array([standardised(row, of, 4).z[4:] for row, of in zip(values, u, strict=True)])
    assert stats.kstest(z.ravel(), "norm").pvalue > 1e-3
    off = np.corrcoef(z.T) - np.eye(z.shape[1])
    assert np.abs(off).max() < 5.0 / np.sqrt(len(z))


def test_values_that_are_all_alike_have_not_changed():
    assert standardised(np.full(15, 4.2), np.ones(15)).z[10:].tolist() == [0.0] * 5


def test_far_values_stay_finite():
    values = np.append(np.zeros(20), 1e9)
    values[::2] += 1e-3
    z = standardised(values, np.ones(21)).z
    assert np.isfinite(z[-1])
    assert z[-1] > 20.0


@pytest.mark.parametrize("count", [0, 1])
def test_nothing_is_held_against_nothing(count):
    assert np.isnan(standardised(np.arange(float(count)), np.ones(count)).z).all()


def test_scatter_about_another_level_counts(rng):
    values = 5.0 + 3.0 * rng.standard_normal(6)
    found = standardised(values, np.ones(6), 10, ScatterRatio(20, 20 * 9.0))
    assert not found.by_stated.any()
    ratio = (values[1] - values[0]) / (np.sqrt(2.0) * 3.0)
    assert found.z[1] == pytest.approx(stats.norm.ppf(stats.t.cdf(ratio, 20)))


def test_in_hindsight_the_scatter_of_all_takes_the_place_of_the_stated_uncertainty(rng):
    values = 4.0 * rng.standard_normal(5)
    found = standardised(values, np.ones(5), 10, hindsight=ScatterRatio(30, 30 * 16.0))
    ratio = (values[1] - values[0]) / (np.sqrt(2.0) * 4.0)
    assert found.z[1] == pytest.approx(stats.norm.ppf(stats.t.cdf(ratio, 30)))
    assert not found.by_stated.any()


def test_a_scatter_contradicts_what_is_stated_by_chance_alone_once_in_twenty(rng):
    squares = np.sum(rng.standard_normal((4_000, 8)) ** 2, axis=1)
    share = np.mean([ScatterRatio(8, square).more_than_stated for square in squares])
    assert share == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / 4_000))
