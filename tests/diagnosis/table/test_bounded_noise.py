"""An effect four times the noise is no noise, though its neighbours resemble each other and no single variable has its form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.diagnosis.table.mismatch import find_mismatch
from tests.diagnosis.table.nulls import moving, table_of

NOISE_MM = 0.02


def test_a_slow_effect_four_times_the_noise_is_found():
    """The product of place and load, twenty rows late: as noise it would have some ten independent samples in 250 rows."""
    rng = np.random.default_rng([77, 2])
    rows = 250
    axis = moving(rng, rows)
    missing = lfilter([0.05], [1.0, -0.95], axis.place * axis.load)
    missing = 4.0 * NOISE_MM * (missing - missing.mean()) / missing.std()
    simulated = axis.place + 0.1 * axis.load
    measured = simulated + NOISE_MM * rng.standard_normal(rows) + missing
    found = find_mismatch(table_of(axis, np.round(measured, 4), np.round(simulated, 4)), hold_out=False)
    assert found.is_there
    assert found.settled.noise.sigma == pytest.approx(NOISE_MM, rel=0.25)
    assert np.corrcoef(found.settled.effect(), missing)[0, 1] > 0.95
