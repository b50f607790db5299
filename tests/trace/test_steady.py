"""Mean and standard uncertainty of one length, against closed forms and brute force."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.trace.steady import steady


def test_a_quantised_length_that_does_not_move_has_the_uncertainty_of_its_last_digit():
    """Rectangular distribution: d / sqrt(12)."""
    found = steady(np.full(200, 150.0003), resolution_mm=1e-4)
    assert (found.mean_mm, found.scatter_mm) == (pytest.approx(150.0003, abs=1e-12), pytest.approx(0.0, abs=1e-12))
    assert found.uncertainty_mm == pytest.approx(1e-4 / np.sqrt(12.0))


def test_the_resolution_is_the_smallest_step_that_is_shown():
    assert steady(150.0 + 1e-4 * np.tile([0, 1, 3, 1], 10)).resolution_mm == pytest.approx(1e-4)
    with pytest.raises(ValueError, match="all readings are equal"):
        steady(np.full(200, 150.0))
    with pytest.raises(ValueError, match="at least 20"):
        steady(np.full(19, 150.0), 1e-4)


def test_the_uncertainty_is_that_of_many_means_whether_readings_are_independent_or_not():
    """Brute force: the mean of a thousand series scatters by what each series states, white noise and vibration alike."""
    rng = np.random.default_rng(4)
    for correlation in (0.0, 0.9):
        means, stated = [], []
        for _ in range(1000):
            noise = rng.normal(0.0, 1.0, 2000)
            if correlation:
                for k in range(1, len(noise)):
                    noise[k] += correlation * noise[k - 1]
            found = steady(noise, 1e-9)
            means.append(found.mean_mm)
            stated.append(found.uncertainty_mm)
        # The variance from ten batches is unbiased but for what neighbouring batches share, some per cent here.
        assert np.sqrt(np.mean(np.square(stated))) == pytest.approx(np.std(means), rel=0.08)
