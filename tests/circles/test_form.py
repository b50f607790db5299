"""Form and noise of a series, where a line of its spectrum is empty."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.circles.form import form_and_noise

THETA = np.radians(np.arange(0.0, 360.0, 0.5))


def test_an_empty_line_is_no_form_and_no_warning(rng):
    deviation_um = np.round(rng.standard_normal(360) * 1024.0) / 1024.0
    deviation_um[-1] = -deviation_um[:-1].sum()
    deviation_um[-1] = np.clip(deviation_um[-1], -3.0, 3.0)
    deviation_um[-2] -= deviation_um.sum()
    apart = form_and_noise(deviation_um)
    assert np.isfinite(apart.form_um).all()
    assert np.abs(np.fft.rfft(apart.form_um)[0]) < 1e-9


@pytest.mark.parametrize("size_um", [0.0, 2.0, 500.0])
def test_a_path_without_any_noise_is_all_form(size_um, rng):
    path = size_um * np.cos(2.0 * THETA)
    found = form_and_noise(path)
    assert found.form_um == pytest.approx(path, abs=1e-9)
    assert np.sqrt(found.power_um2.max()) < 1e-9 * max(size_um, 1.0)
    assert np.isfinite(found.continued.drawn(rng, 20)).all()
