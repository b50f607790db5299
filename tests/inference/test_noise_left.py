"""The noise that is read from what a model of very many columns leaves, against the noise that was put in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.inference.harmonics import LOW, noise_left_by

SAMPLES, RUNS, REPEATS = 360, 4, 30
LEVEL = 0.3
DRAWS = 4
PHASE = np.linspace(0.0, 2 * np.pi, SAMPLES, endpoint=False)


def wide_model(rng, smooth, waves, highest):
    """What a ridge fit leaves: of smooth columns over all runs, and of waves like those of screws at high harmonics."""
    orders = np.r_[rng.uniform(0, 30, smooth), rng.uniform(50, highest, waves)]
    columns = [
        np.sin(orders * PHASE[:, None] + rng.uniform(0, 2 * np.pi, len(orders))) * rng.normal(size=len(orders))
        for _ in range(RUNS)
    ]
    axes, seen, _ = np.linalg.svd(np.vstack(columns), full_matrices=False)
    taken = seen**2 / (seen**2 + LEVEL**2)
    return lambda samples: samples - axes @ (taken[:, None] * (axes.T @ samples))


def measured(model, noise, rng):
    left = model(np.column_stack([noise, rng.normal(size=(RUNS * SAMPLES, DRAWS))])).reshape(RUNS, SAMPLES, -1)
    return noise_left_by([run[:, 0] for run in left], [PHASE] * RUNS, [run[:, 1:] for run in left])


def correlated(rng, correlation):
    """First-order process in every run, and the mean power of its low harmonics in closed form."""
    runs = [lfilter([1], [1, -correlation], LEVEL * rng.normal(size=SAMPLES + 300))[300:] for _ in range(RUNS)]
    turn = np.exp(-2j * np.pi * np.arange(LOW + 1) / SAMPLES)
    return np.concatenate(runs), float(np.mean(LEVEL**2 / np.abs(1 - correlation * turn) ** 2))


@pytest.mark.parametrize("correlation", [0.0, 0.7])
@pytest.mark.parametrize(("smooth", "waves", "highest"), [(1, 1, 120), (100, 100, 80), (150, 250, 120)])
def test_the_level_is_right_whatever_a_wide_model_takes_out(rng, smooth, waves, highest, correlation):
    """No bias, and no more scatter than the stated freedom says.

    Thirty deviations have a mean within 0.7: over 300 draws it was 0.05 and their scatter 1.2, as four draws of white
    noise do not know what is taken out exactly, and thirty scatter by 0.2 three times over. Correlated noise
    has its corner below the harmonics that it is read from: there the tendency must stay below what is stated.
    """
    model = wide_model(rng, smooth, waves, highest)
    ratios, deviations = [], []
    for _ in range(REPEATS):
        noise, power = correlated(rng, correlation)
        found = measured(model, noise, rng)
        ratios.append(found.power.mean() / power)
        deviations.append(np.log(ratios[-1]) / np.sqrt(2.0 / found.freedom))
    if correlation == 0.0:
        assert np.median(ratios) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(deviations)) < (0.7 if correlation == 0.0 else 1.0)
    assert np.std(deviations) < 1.5


def test_what_keeps_nothing_says_nothing(rng):
    found = measured(lambda samples: 1e-3 * samples, rng.normal(size=RUNS * SAMPLES), rng)
    assert not found.power.any()
