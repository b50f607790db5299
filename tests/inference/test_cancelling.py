"""Effects that cancel each other are those larger than all together, where three quarters of the squares are gone."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.alternatives import cancelling

ANGLE = 2.0 * np.pi * np.arange(1000) / 1000.0
ONCE, TWICE = np.sin(ANGLE), np.sin(2.0 * ANGLE)
RMS = np.sqrt(0.5)


def test_three_effects_that_explain_less_than_each_of_them():
    found = cancelling({"a": 5.8 * ONCE, "b": -4.6 * ONCE, "c": 0.3 * TWICE}, "mm")
    assert found.rms == pytest.approx({"a": 5.8 * RMS, "b": 4.6 * RMS})
    assert found.rms_of_sum == pytest.approx(np.hypot(1.2, 0.3) * RMS)


@pytest.mark.parametrize("second", [TWICE, ONCE, -0.2 * ONCE, 3.0 + TWICE])
def test_effects_that_have_little_to_do_with_each_other_or_add_up(second):
    assert cancelling({"a": ONCE, "b": second}, "mm") is None


def test_one_effect_or_none():
    assert cancelling({"a": ONCE}, "mm") is None
    assert cancelling({}, "mm") is None
