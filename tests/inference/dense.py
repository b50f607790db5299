"""A linear problem beside a flat base, and its marginal likelihoods as dense Gaussian integrals.

Nothing of the package's inference is used here but the type of what it is asked.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from dbbstation.inference.model_comparison import Cause, ModelComparison, Variant

EVEN_ODDS = 0.0


class Dense:
    """Target = flat base + causes' columns + white noise."""

    def __init__(self, base, columns, target, noise):
        # All that a flat base leaves of a measurement is what is orthogonal to it.
        self.beside = null_space(base.T)
        self.columns, self.target = self.beside.T @ columns, self.beside.T @ target
        self.noise = noise

    def comparison(self):
        gram = self.columns.T @ self.columns
        return ModelComparison(gram / self.noise**2, self.columns.T @ self.target / self.noise**2)

    def log_evidence(self, columns, sd):
        """Log marginal likelihood of columns with these prior standard deviations over that of none."""
        white = self.noise**2 * np.eye(len(self.target))
        size = self.columns[:, columns] * sd
        with_them = multivariate_normal.logpdf(self.target, cov=white + size @ size.T)
        return with_them - multivariate_normal.logpdf(self.target, cov=white)

    def log_likelihood(self, columns, amplitudes):
        """Log likelihood of amplitudes over that of none."""
        left = self.target - self.columns[:, columns] @ amplitudes
        return 0.5 * (self.target @ self.target - left @ left) / self.noise**2


def variant(*columns, plausible=1.0, **known):
    return Variant(np.array(columns), np.full(len(columns), plausible), **known)


def cause(name, *variants, odds=EVEN_ODDS, named=True):
    return Cause(name, variants, odds, named=named)
