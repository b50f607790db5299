"""The encoder's place without noise, against SciPy's filter of Savitzky and Golay."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from dbbstation.sources.contract import Motion
from dbbstation.sources.laws.motion import CUBIC, WINDOWS, reading_without_noise_mm


@pytest.mark.parametrize("count", [170, 720, 4001])
def test_a_reading_is_fitted_by_cubics(rng: np.random.Generator, count: int) -> None:
    read = 150.0 + 1e-3 * np.cumsum(rng.standard_normal(count))
    lead_in = [1.0, 2.0]
    motion = Motion(
        np.zeros((count + 2, 6)), kept=slice(2, None), reading_mm=np.append(lead_in, read), reading_is_measured=True
    )
    found = reading_without_noise_mm(motion)
    assert found[:2].tolist() == lead_in
    window = 2 * (count // (2 * WINDOWS)) + 1
    assert found[2:] == pytest.approx(savgol_filter(read, window, CUBIC), rel=0.0, abs=1e-9)
