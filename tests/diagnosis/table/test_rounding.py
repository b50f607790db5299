"""Values of a sensor that are multiples of a step: what was rounded off is noise that is always there."""

from __future__ import annotations

import numpy as np
import pytest

from tests.diagnosis.table.nulls import moving, table_of

STEP_MM = 0.25


def test_noise_is_at_least_that_of_rounding(rng):
    axis = moving(rng, 400)
    rounded = STEP_MM * np.round((axis.place + rng.normal(0.0, 0.001, 400)) / STEP_MM)
    # A rectangular distribution as wide as the step.
    channel = table_of(axis, rounded, axis.place).channel()
    assert channel.least_noise == pytest.approx(STEP_MM / np.sqrt(12.0))
    assert channel.step == pytest.approx(STEP_MM)


def test_targets_that_are_multiples_of_a_step_are_no_rounding(rng):
    axis = moving(rng, 400)
    targets = 10.0 * np.round(axis.place / 10.0)
    measured = targets + rng.normal(0.0, 0.004, 400)
    assert table_of(axis, measured, targets).channel().least_noise < 1e-4
