"""The length of a noisy vector against draws, and against the limits of Rice's distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from dbbstation.circles.extremes import without_noise

DRAWS = 2_000


@pytest.mark.parametrize("true", [0.0, 1.0, 2.0, 3.0, 10.0])
def test_the_interval_holds_the_true_length(rng, true):
    lengths = 0.5 * np.hypot(true + rng.standard_normal(DRAWS), rng.standard_normal(DRAWS))
    found = np.array([without_noise(length, 0.5) for length in lengths])
    inside = np.sum(np.abs(found[:, 0] - 0.5 * true) <= 2.0 * found[:, 1])
    assert inside >= binom.ppf(1e-4, DRAWS, 0.95)
    assert inside <= binom.ppf(1.0 - 1e-4, DRAWS, 0.98)


def test_a_long_vector_has_the_uncertainty_along_it():
    """Noise across a vector makes it longer by u² / 2 L; both branches say the same."""
    for length in (50.0, 99.9, 100.1, 1e5):
        value, u = without_noise(length, 1.0)
        assert value == pytest.approx(length - 0.5 / length, abs=2e-5)
        assert u == pytest.approx(1.0, abs=0.01)


def test_what_noise_alone_shows_is_zero_with_an_uncertainty():
    value, u = without_noise(0.5, 1.0)
    assert value == 0.0
    assert u >= 1.0


def test_a_vector_without_noise_is_as_long_as_it_is():
    assert without_noise(3.0, 0.0) == (3.0, 0.0)
    assert without_noise(0.0, 0.0) == (0.0, 0.0)
