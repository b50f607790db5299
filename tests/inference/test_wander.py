"""A slow wander of rows as an effect in time, against dense covariances of a random walk."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel, Kind, Variable
from dbbstation.inference.levels import FollowsAnswer
from dbbstation.inference.model_comparison import Member
from dbbstation.inference.patterns import WALK_STEPS, wander
from tests.diagnosis.table.nulls import null_table


def clock(values):
    return Variable("t_s", "s", Kind.TIME, np.asarray(values, dtype=np.float64))


def test_its_evidence_is_that_of_a_random_walk():
    """Rows at the ends of its pieces, in white noise, so that the covariance is exact: 6 min(s, t) / T beside the noise."""
    t, sigma, scale = np.arange(WALK_STEPS + 1) * 2.5, 0.3, 0.1
    rng = np.random.default_rng(5)
    rows = sigma * rng.standard_normal(len(t)) + np.cumsum(rng.standard_normal(len(t)))
    base = Base.flat((), np.zeros((len(t), 0)))
    bank = Bank(Channel(rows, "um", (slice(0, len(t)),), ("run",), (clock(t),), base))
    bank.add(wander(clock(t), (slice(0, len(t)),)))
    (cause,) = bank.causes
    noise = bank.noise.innovation
    found = bank.beside().comparison(bank.target).log_evidence([Member(cause, cause.variants[0], scale)])
    walk = 6.0 * np.minimum(t[:, None], t) / t[-1] * (scale * bank.channel.size) ** 2
    white = noise**2 * np.eye(len(t))
    expected = multivariate_normal(cov=walk + white).logpdf(rows) - multivariate_normal(cov=white).logpdf(rows)
    assert found == pytest.approx(expected, abs=1e-9)


def test_it_deviates_by_one_from_its_mean_on_average():
    """The mean square deviation of Brownian motion over T from its own mean is T / 6, and over each of k pieces T / 6k from a straight
    line, with a mean of variance T / 12k³."""
    (one,), k = wander(clock(np.linspace(3.0, 9.0, 5001)), (slice(0, 5001),)), WALK_STEPS
    away = one.samples - one.samples.mean(axis=0)
    assert np.mean(np.sum(away**2, axis=1)) == pytest.approx(1.0 - 1.0 / k + 1.0 / (2.0 * k**2), abs=1e-3)


def test_it_goes_on_where_a_run_ends_and_stands_between_runs():
    t, blocks = np.array([0.0, 1.0, 2.0, 50.0, 51.0, 52.0]), (slice(0, 3), slice(3, 6))
    (together,) = wander(clock([0.0, 1.0, 2.0, 2.0, 3.0, 4.0]), (slice(0, 6),))
    (apart,) = wander(clock(t), blocks)
    np.testing.assert_allclose(apart.samples, together.samples)
    assert not wander(clock(np.ones(3)), (slice(0, 3),))


@pytest.mark.slow
@pytest.mark.usefixtures("few_parts")
@pytest.mark.parametrize("seed", [20_101, pytest.param(20_104, marks=pytest.mark.nightly)])
def test_a_random_walk_follows_no_variable_but_time(seed):
    levels = find_mismatch(null_table("walk", seed)).levels
    assert [one.name for one in levels.follows] == ["time"]
    assert all(one.answer in {FollowsAnswer.GOES_ON, FollowsAnswer.HAPPENED} for one in levels.follows)
