"""Probabilities mean what they say where truth is drawn from the prior.

[Talts, Betancourt, Simpson, Vehtari and Gelman, Validating Bayesian inference algorithms with simulation-based
calibration, arXiv:1804.06788 (2018)]
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import chi2, chisquare

from dbbstation.inference.hypotheses import search
from dbbstation.inference.model_comparison import LOG_SCALE_WEIGHTS, SCALES, Member
from tests.inference.dense import Dense, cause, variant
from tests.inference.subsets import inclusion, log_posteriors

SAMPLES = 30
NOISE = 0.5
T = np.linspace(0.0, 1.0, SAMPLES)
BASE = np.column_stack([np.ones(SAMPLES), T])
WEIGHTS = np.exp(LOG_SCALE_WEIGHTS)
THERE = 0.16
"""Probability of each of four causes: half of the draws have one or more."""

ODDS = float(np.log(THERE / (1.0 - THERE)))
BINS = np.array([0.0, 0.08, 0.16, 0.3, 0.6, 0.9, 0.99, 1.0])


def drawn(rng, causes, there):
    """A problem from the prior, and its amplitudes; columns are a little alike."""
    columns = rng.normal(size=(SAMPLES, causes)) + 0.7 * rng.normal(size=(SAMPLES, 1))
    sizes = rng.choice(SCALES, causes, p=WEIGHTS)
    amplitudes = np.where(rng.random(causes) < there, sizes * rng.normal(size=causes), 0.0)
    target = BASE @ [3.0, 1.0] + columns @ amplitudes + rng.normal(0, NOISE, SAMPLES)
    return Dense(BASE, columns, target, NOISE), amplitudes


def reliability(said, true):
    """By bin of what was said: how many, how many were true, how many were to be expected, and their variance."""
    place = np.digitize(said, BINS[1:-1])
    return np.array(
        [
            [np.sum(own), np.sum(true[own]), np.sum(said[own]), np.sum(said[own] * (1.0 - said[own]))]
            for own in (place == k for k in range(len(BINS) - 1))
        ]
    ).T


@pytest.fixture(scope="module")
def outcomes():
    """What the search says and what all sets and sizes say of 400 draws, and what was true, shape (draws x causes,)."""
    rng = np.random.default_rng(20260715)
    causes = [cause(f"c{k}", variant(k), odds=ODDS) for k in range(4)]
    names = [c.name for c in causes]
    found = []
    for _ in range(400):
        problem, amplitudes = drawn(rng, 4, THERE)
        posterior = search(problem.comparison(), causes)
        by_search = [posterior.probability([name]) for name in names]
        found.append([by_search, inclusion(log_posteriors(problem, causes), names), amplitudes != 0.0])
    return np.array(found, dtype=float).transpose(1, 0, 2).reshape(3, -1)


def improbability(count, true, expected, variance):
    """Probability of such a misfit of frequencies or a larger one, over bins that hold enough."""
    used = (count >= 10) & (variance > 0.5)
    assert used.sum() >= 2
    return chi2.sf(np.sum((true - expected)[used] ** 2 / variance[used]), used.sum())


def test_half_of_the_draws_have_a_cause(outcomes):
    assert np.mean(outcomes[2].reshape(-1, 4).any(axis=1)) == pytest.approx(0.5, abs=0.08)


def test_the_prior_and_the_integrals_of_the_check_are_calibrated(outcomes):
    assert improbability(*reliability(outcomes[1], outcomes[2])) > 0.01


def test_what_the_search_says_is_true_as_often(outcomes):
    """From 0.3 on; below, sets of several causes that are each not worth their odds are missing, see the next test."""
    likely = outcomes[:, outcomes[0] > 0.3]
    assert improbability(*reliability(likely[0], likely[2])) > 0.01


def test_unlikely_causes_are_said_to_be_less_likely_than_they_are_by_no_more_than_the_odds_of_all(outcomes):
    """Beside n causes that show nothing, one of odds o has o / (1 + n o) instead of o / (1 + o)."""
    said, exact, _ = outcomes[:, outcomes[0] < 0.3]
    odds = THERE / (1.0 - THERE)
    assert np.all(exact < said * (1.0 + 4 * odds) + 0.01)
    assert np.all(said < exact + 0.01)


def test_true_amplitudes_have_every_rank_among_posterior_draws_alike():
    rng = np.random.default_rng(20260716)
    causes = [cause(f"c{k}", variant(k)) for k in range(2)]
    draws, ranks = 19, []
    sizes = list(product(range(len(SCALES)), repeat=2))
    for _ in range(400):
        problem, amplitudes = drawn(rng, 2, 1.0)
        comparison = problem.comparison()
        members = [
            [Member(c, c.variants[0], float(SCALES[k])) for c, k in zip(causes, pair, strict=True)] for pair in sizes
        ]
        weights = np.array([comparison.log_evidence(m) for m in members])
        weights += [LOG_SCALE_WEIGHTS[list(pair)].sum() for pair in sizes]
        taken = rng.choice(len(sizes), draws, p=np.exp(weights - logsumexp(weights)))
        sampled = []
        for k in taken:
            estimates = comparison.estimates(members[k])
            sampled.append(rng.multivariate_normal(estimates.values, estimates.covariance, method="cholesky"))
        ranks.append((np.array(sampled) < amplitudes).sum(axis=0))
    for own in np.array(ranks).T:
        assert chisquare(np.bincount(own, minlength=draws + 1)).pvalue > 0.01
