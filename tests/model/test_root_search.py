"""Zeros of several functions at once, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.model.compensation import RootSearch


def searched(function, guess, met=1e-10):
    search, asked = RootSearch(np.array(guess, dtype=float), met), 0
    while not search.done:
        search.tell(function(search.at))
        asked += 1
    return search, asked


@pytest.mark.parametrize("offset", [-3e-3, 1e-7, 5e-3])
def test_play_is_crossed_in_few_steps(offset):
    """y follows x at either end of a play of 6 µm; it shall stand at a place beside the last."""
    place = np.array([0.0, 1.0, -2.0])
    wanted = place + offset * np.array([1.0, -1.0, 0.5])
    search, asked = searched(lambda x: wanted - np.clip(place, x - 3e-3, x + 3e-3), place - 3e-3)
    assert np.allclose(search.at, wanted + 3e-3 * np.sign(wanted - place), rtol=0, atol=1e-9)
    assert asked < 40


def test_functions_that_touch_each_other_are_met_together():
    matrix = np.array([[1.0, 2e-3, -1e-3], [1e-3, 0.5, 2e-3], [0.0, 1e-3, 2.0]])
    wanted = np.array([0.3, -0.2, 0.1])
    search, _ = searched(lambda x: matrix @ (wanted - x), np.zeros(3))
    assert np.allclose(search.at, wanted, rtol=0, atol=1e-9)


def test_where_a_function_jumps_the_nearer_side_is_taken():
    def jumps(x):
        return np.where(x < 0.25, 1e-3 - 1e-4 * x, -5e-3 - 1e-4 * x)

    search, _ = searched(jumps, [0.0])
    assert search.lost == 0
    assert search.at[0] == pytest.approx(0.25, abs=1e-11)
    assert search.at[0] < 0.25


def test_one_that_is_never_zero_is_told_by_its_number():
    search, _ = searched(lambda x: np.array([-x[0], 1.0]), [0.1, 0.0])
    assert search.lost == 2
