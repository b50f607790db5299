"""Stretches that are louder than others: how often noise makes it seem so, and what an oscillation after an event does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.diagnosis.locate import louder

RUNS, ROWS, LENGTH = 20, 600, 12


def noise(rng, memory):
    pushes = rng.standard_normal((RUNS, ROWS + 200)) * np.sqrt(1.0 - memory**2)
    return list(lfilter([1.0], [1.0, -memory], pushes, axis=1)[:, 200:])


def events(rng):
    return [np.sort(rng.choice(ROWS, 4, replace=False)) for _ in range(RUNS)]


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_noise_that_is_the_same_everywhere_is_louder_by_chance_as_often_as_said(memory):
    rng = np.random.default_rng(31)
    chances = np.array([louder(noise(rng, memory), events(rng), LENGTH).probability for _ in range(200)])
    # 200 draws: 10 are expected below 0.05, 3.1 their standard deviation; 2 below 0.01.
    assert 0 < np.sum(chances < 0.05) <= 20
    assert np.sum(chances < 0.01) <= 8


def test_what_rings_after_events_is_found_with_its_size_though_it_makes_up_much_of_the_noise():
    rng = np.random.default_rng(32)
    residuals, begins = noise(rng, 0.6), events(rng)
    for residual, rows in zip(residuals, begins, strict=True):
        for row in rows:
            own = residual[row : row + LENGTH]
            own += np.sqrt(2.0) * np.cos(np.arange(len(own)))
    found = louder(residuals, begins, LENGTH)
    assert found.probability < 1e-8
    # A cosine of amplitude √2 has a root mean square of one.
    assert found.beyond == pytest.approx(1.0, abs=0.15)
    assert found.elsewhere == pytest.approx(1.0, abs=0.1)


def test_few_stretches_say_nothing():
    residuals = [np.random.default_rng(33).standard_normal(ROWS)]
    assert louder(residuals, [np.array([5, 100])], LENGTH) is None
    assert louder([np.zeros(ROWS)] * RUNS, [np.array([5, 100])] * RUNS, LENGTH) is None
