"""Power laws below the band that noise is read from, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.circles.continued import CORNERS, EXPONENTS, SLOWEST, _processes


def test_the_mean_of_a_turn_under_flicker():
    """Of power 1/f from f0 on a window of one turn passes 2 (3/2 - C - ln 2 pi f0), C Euler's constant, but for terms of f0 squared."""
    found = _processes(np.arange(31.0))[len(CORNERS) + list(EXPONENTS).index(1.0)]
    assert found[0] == pytest.approx(2.0 * (1.5 - np.euler_gamma - np.log(2.0 * np.pi * SLOWEST)), rel=1e-3)
    assert found[10] == pytest.approx(0.1)


def test_the_centre_sees_more_of_a_law_than_its_line_has():
    """Drawn: white noise through the law, 100 turns long, one turn of it; its power at line 1 is known to 3 percent."""
    rng, turns, count = np.random.default_rng(3), 100, 64
    cycles = np.fft.rfftfreq(turns * count, 1.0 / count)
    shape = np.where(cycles > 0.0, np.maximum(cycles, SLOWEST) ** -0.5, 0.0)
    power = []
    for _ in range(40):
        long = np.fft.irfft(np.fft.rfft(rng.standard_normal(turns * count)) * shape, turns * count)
        power.append(np.mean(np.abs(np.fft.rfft(long.reshape(turns, count), axis=1)) ** 2, axis=0) / count)
    found = _processes(np.arange(3.0))[len(CORNERS) + list(EXPONENTS).index(1.0)]
    assert np.mean(power, axis=0)[1] == pytest.approx(found[1], rel=0.1)
