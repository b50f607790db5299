"""Slack columns without the directions that noise hides."""

from __future__ import annotations

import numpy as np

from dbbstation.diagnosis.discrepancy import seen_of


def test_axes_stand_for_the_covariance_of_columns_up_to_the_least(rng):
    columns = rng.normal(size=(60, 8)) * np.array([3.0, 2.0, 1.0, 0.5, 1e-3, 1e-4, 1e-5, 1e-6])
    columns[:, 3] = columns[:, 0]
    seen = seen_of(columns, 1.0, 0.05)
    assert seen.shape == (60, 3)
    lacking = columns @ columns.T - seen @ seen.T
    assert np.linalg.eigvalsh(lacking).max() < 0.05**2
    assert seen_of(columns, 1.0, 0.0).shape[1] >= 7
    assert seen_of(columns, 0.2, 0.01).shape == seen.shape
    assert seen_of(np.zeros((60, 0)), 1.0, 0.05).shape == (60, 0)


def test_what_is_left_out_moves_a_log_bayes_factor_by_no_more_than_half_its_square(rng):
    """A direction of a tenth of a standard deviation: at most 0.005, by the determinants of the covariances."""
    noise, least = 0.4, 0.04
    columns = rng.normal(size=(60, 5)) @ np.diag([0.3, 0.1, 0.004, 0.003, 0.002])
    seen = seen_of(columns, 1.0, least)
    left_out = columns.shape[1] - seen.shape[1]
    whole, less = (np.linalg.slogdet(np.eye(60) + each @ each.T / noise**2)[1] for each in (columns, seen))
    assert left_out == 3
    assert 0.0 <= 0.5 * (whole - less) <= 0.005 * left_out
