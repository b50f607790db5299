"""The bent scale of the bar: against a parabola by hand, and a linear part that nobody can see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.sources.causes.bar_scale import BarScale
from dbbstation.sources.contract import Motion
from tests.sources.runs import random_run

SCALE = BarScale()


def test_the_error_is_a_parabola_of_the_way_from_the_nominal_length(reference):
    reading_mm = np.array([149.8, 149.9, 150.0, 150.1, 150.3])
    motion = replace(random_run(np.random.default_rng(1), 5), reading_mm=reading_mm)
    error_um = 1e3 * SCALE.effect(motion, reference, np.array([0.7])).reading_mm
    assert error_um == pytest.approx([2.8, 0.7, 0.0, 0.7, 6.3])


def test_bars_of_any_length_count_from_their_own_millimetre(reference):
    here, there = (
        SCALE.effect(
            replace(random_run(np.random.default_rng(1), 3), reading_mm=bar_mm + np.array([-0.05, 0.0, 0.05])),
            reference,
            np.array([1.0]),
        ).reading_mm
        for bar_mm in (100.0, 300.0)
    )
    assert here == pytest.approx(there)


def test_noise_of_the_readings_is_not_followed(rng):
    true_mm = 150.0 + 0.1 * np.sin(np.linspace(0.0, 2.0 * np.pi, 2000))
    alike = []
    for _ in range(30):
        noise = rng.normal(0.0, 1e-3, len(true_mm))
        motion = Motion(np.zeros((2000, 6)), reading_mm=true_mm + noise, reading_is_measured=True)
        own = SCALE.derivative(motion, None, np.zeros(1)).reading_mm[:, 0]
        exact = 1e-3 * ((true_mm - 150.0) / 0.1) ** 2
        left = own - exact
        assert np.abs(left).max() < 0.05 * exact.max()
        alike.append(float(left @ noise) / (1e-3 * float(np.linalg.norm(exact))))
    # Of size one for a column that knows nothing of the noise.
    assert abs(np.mean(alike)) < 1.0


def test_a_motion_without_readings_is_refused(reference, rng):
    with pytest.raises(ModelError, match="bar-scale needs reading"):
        SCALE.effect(replace(random_run(rng), reading_mm=None), reference, np.array([1.0]))
