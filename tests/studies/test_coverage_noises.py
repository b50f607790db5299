"""Circles under noise that the program has no model of, and the feed that recordings show; whole sizes are commands."""

from __future__ import annotations

import numpy as np
import pytest

from studies.coverage_feed import coverage_of_feed
from studies.coverage_noises import COVERAGE_FACTOR, OF_BOTH, OF_ONE, coverage_of_noises, drawn_values
from tests.plant.other_noise import KINDS, TURNS, flicker


@pytest.mark.parametrize("sessions", [60, pytest.param(400, marks=pytest.mark.nightly)])
def test_flicker_has_as_much_power_in_every_octave(sessions):
    """What defines 1/f noise; that of the lowest octave, four waves, is known to 6 % from sixty sessions, one standard deviation."""
    rng, count = np.random.default_rng(5), 1024
    power = np.mean([np.abs(np.fft.rfft(flicker(rng, count))) ** 2 for _ in range(sessions)], axis=0)
    octaves = np.array([power[2**k : 2 ** (k + 1)].sum() for k in range(2, 7)])
    assert octaves == pytest.approx(octaves.mean(), rel=0.25)
    assert TURNS > 1


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "1/f"])
def test_noises_have_a_standard_deviation_of_one(kind):
    rng = np.random.default_rng(6)
    drawn = np.concatenate([KINDS[kind](rng, 720) for _ in range(200)])
    assert np.std(drawn) == pytest.approx(1.0, rel=0.06)


@pytest.mark.slow
def test_flicker_is_in_u_of_the_radius():
    """Continued by memories alone, U of the radius held 18 % of 200; of 24, 16 would be inside by a chance of 1e-4 were it 93 %."""
    off = np.array([drawn_values("1/f", seed)["radius"] for seed in range(24)])
    assert np.count_nonzero(np.abs(off[:, 0]) <= COVERAGE_FACTOR * off[:, 1]) > 16


@pytest.mark.slow
def test_rows_of_noises_and_of_the_feed():
    told = []
    rows = coverage_of_noises(2, 3, told.append, kinds=("vibration", "coarse gauge"))
    assert [row.figure for row in rows] == [str(figure) for figure in (*OF_ONE, *OF_BOTH)] * 2
    assert told == [1, 2, 3, 4]
    (feed,) = coverage_of_feed(80, 1, told.append)
    assert feed.values > 20
    assert feed.fault == ""
