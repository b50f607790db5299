"""The jackknife against closed forms and against the spread of many fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.inference.jackknife import jackknife_covariance
from dbbstation.inference.square_root import compress


def blocks_of(columns, target, count):
    numbers = np.arange(columns.shape[1])
    parts = np.array_split(np.arange(len(target)), count)
    return [compress(numbers, columns[rows], target[rows]) for rows in parts]


def test_a_mean_has_the_variance_of_the_block_means(rng):
    """Of equal blocks the delete-one jackknife of a mean is the variance of the block means over their number."""
    target = rng.normal(3.0, 2.0, 400)
    means = target.reshape(20, 20).mean(axis=1)
    covariance = jackknife_covariance(blocks_of(np.ones((400, 1)), target, 20), 1)
    assert covariance[0, 0] == pytest.approx(means.var(ddof=1) / 20, rel=1e-9)


def test_correlated_noise_of_changing_size_is_allowed_for(rng):
    """Against the spread of 200 fits; white noise of the same size would be stated several times too small."""
    t = np.linspace(0.0, 1.0, 3000)
    columns = np.column_stack([np.ones_like(t), np.sin(6 * np.pi * t)])
    size = 0.2 + (t % 0.25 > 0.125)
    fits, stated = [], []
    for _ in range(200):
        noise = size * lfilter([1.0], [1.0, -0.95], rng.normal(0.0, 0.1, len(t)))
        fits.append(np.linalg.lstsq(columns, noise, rcond=None)[0])
        stated.append(np.diag(jackknife_covariance(blocks_of(columns, noise, 24), 2)))
    spread, stated_sigma = np.std(fits, axis=0), np.sqrt(np.mean(stated, axis=0))
    assert stated_sigma == pytest.approx(spread, rel=0.2)


def test_what_one_block_alone_knows_is_uncertain(rng):
    columns = np.column_stack([np.ones(300), np.r_[np.ones(30), np.zeros(270)]])
    target = columns @ [1.0, 5.0] + rng.normal(0.0, 0.01, 300)
    covariance = jackknife_covariance(blocks_of(columns, target, 10), 2)
    assert np.sqrt(covariance[1, 1]) > 1.0
