"""Posterior over all sets of causes and all sizes of each, by brute force."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from scipy.special import logsumexp

from dbbstation.inference.model_comparison import LOG_SCALE_WEIGHTS, SCALES


def log_posteriors(problem, causes):
    """Log posterior of every set of names, averaged over all combinations of sizes; one variant for each cause.

    Written with the target's covariance in the space of the columns (the matrix determinant lemma), apart from the
    package's.
    """
    white, target = problem.columns / problem.noise, problem.target / problem.noise
    found = {}
    for count in range(len(causes) + 1):
        sizes = np.array(list(product(range(len(SCALES)), repeat=count)), dtype=int).reshape(
            len(SCALES) ** count, count
        )
        for chosen in combinations(causes, count):
            columns = np.concatenate([np.zeros(0, dtype=int), *(c.variants[0].columns for c in chosen)])
            lengths = [len(c.variants[0].columns) for c in chosen]
            plausible = np.concatenate([np.zeros(0), *(c.variants[0].plausible for c in chosen)])
            sd = np.repeat(SCALES[sizes], lengths, axis=1) * plausible
            own = white[:, columns]
            matrix = np.eye(len(columns)) + sd[:, :, None] * (own.T @ own) * sd[:, None, :]
            along = sd * (own.T @ target)
            solved = np.linalg.solve(matrix, along[:, :, None])[:, :, 0]
            evidence = 0.5 * np.sum(along * solved, axis=1) - 0.5 * np.linalg.slogdet(matrix)[1]
            odds = sum(c.log_prior_odds for c in chosen)
            weights = LOG_SCALE_WEIGHTS[sizes].sum(axis=1)
            found[frozenset(c.name for c in chosen)] = float(logsumexp(evidence + weights)) + odds
    return found


def inclusion(log_posterior, names):
    total = logsumexp(list(log_posterior.values()))
    return np.array([np.exp(logsumexp([v for key, v in log_posterior.items() if n in key]) - total) for n in names])
