"""Wind-up against closed forms of Dahl's law."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.laws.presliding import wound, wound_up


def side_of(travel, length, state=None):
    side, _, _ = wound_up(travel[:, None], np.array([length]), wound(travel[:, None]) if state is None else state)
    return side[:, 0]


@pytest.mark.parametrize("length", [0.001, 0.03, 0.1])
def test_behind_a_reversal_it_turns_round_exponentially_along_the_way(length):
    t = np.linspace(0, 4 * np.pi, 4801)  # the turning points are samples
    travel = np.sin(t)
    # Since its last turning point (+1 or -1) the drive has travelled |x -+ 1|; a stroke of 2 winds it up wholly.
    shrinking = np.cos(t) < 0
    since = np.where(shrinking, 1 - travel, 1 + travel)
    expected = np.where(shrinking, 1, -1) * (0.5 - np.exp(-since / length))
    # Before its first turning point the strut grows as if it always had.
    expected[t <= np.pi / 2] = -0.5
    assert np.allclose(side_of(travel, length), expected, atol=1e-8)


def test_small_strokes_wind_up_in_part():
    """Strokes of half a length to and fro: the loop between +z and -z closes where z = tanh(h / 2l) / 2, h the stroke."""
    stroke, length = 0.05, 0.1
    travel = np.concatenate([[0.0], np.cumsum(np.tile([stroke, -stroke], 200))])
    side = side_of(travel, length)
    assert side[-1] == pytest.approx(0.5 * np.tanh(stroke / (2 * length)), rel=1e-9)
    assert side[-2] == pytest.approx(-0.5 * np.tanh(stroke / (2 * length)), rel=1e-9)


def test_it_does_not_hang_on_the_sampling(rng):
    path = np.cumsum(rng.normal(0, 1, 40))
    coarse = side_of(path, 0.7)
    fine = side_of(np.interp(np.linspace(0, 39, 39 * 50 + 1), np.arange(40), path), 0.7)
    assert np.allclose(fine[::50], coarse, atol=1e-9)


def test_a_strut_at_rest_is_not_wound_up():
    assert not side_of(np.full(50, 812.5), 0.05).any()
