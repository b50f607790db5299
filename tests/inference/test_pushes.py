"""Stretches of time: how many events they are, and that too many of them are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.facts.value import Value
from dbbstation.inference.levels import Verdict, distinct_sizes, most_of_one_size, too_many, within_a_step
from dbbstation.inference.settle import settle
from tests.inference.reading import read_by_levels
from tests.inference.tables import table
from tests.inference.test_channel import channel, of_time


def sizes(*values, sigma=0.1):
    return [Value(value, sigma, "mm") for value in values]


def test_sizes_that_agree_count_once():
    assert distinct_sizes([]) == 0
    assert distinct_sizes(sizes(1.0)) == 1
    assert most_of_one_size(sizes(1.0, -2.0, 1.1, 5.0)) == [0, 2]
    assert distinct_sizes(sizes(1.0, -2.0, 1.1, 5.0)) == 3


def test_more_than_eight_sizes_are_too_many():
    assert not too_many(sizes(*range(1, 9)))
    assert "9 stretches of time would be needed, 9 of them" in too_many(sizes(*range(1, 10)))
    assert not too_many(sizes(*[5.0] * 30))


def test_a_stretch_within_a_step_of_the_readings_may_be_rounding():
    assert "step of 0.3 mm" in within_a_step(sizes(0.3, -0.32, sigma=0.02), 0.3)
    assert not within_a_step(sizes(0.3, -0.6, sigma=0.02), 0.3)
    assert not within_a_step(sizes(0.3, -0.32, sigma=0.02), 0.0)


def test_rounding_of_a_slow_value_is_no_event():
    """A line that rises by two steps in 400 rows, read in steps with little noise, less the line."""
    whole = channel(table(4, rows=400), blocks=1)
    line = np.linspace(0.0, 0.5, 400) + 0.01 * np.random.default_rng(2).standard_normal(400)
    rounded = replace(
        whole,
        residual=0.25 * np.round(line / 0.25) - np.linspace(0.0, 0.5, 400),
        step=0.25,
        least_noise=0.25 / np.sqrt(12.0),
    )
    found = read_by_levels(settle(rounded, thorough=False))
    assert not [one.name for one in found if one.verdict is Verdict.HAPPENED and one.form == "pulses"]


@pytest.mark.parametrize("equal", [True, False])
def test_a_dozen_pulses_happened_only_where_they_are_of_one_size(equal):
    """Twelve stretches of 15 rows in white noise of 0.1: either all of 1, or each of a size of its own."""
    whole = of_time(table(4, rows=360), blocks=1)
    heights = np.ones(12) if equal else np.random.default_rng(3).permutation(np.linspace(0.7, 4.0, 12))
    pulses = np.repeat(heights, 30) * (np.arange(360) % 30 >= 15)
    settled = settle(replace(whole, residual=whole.residual + pulses), thorough=False)
    found = [one for one in read_by_levels(settled) if one.name in settled.best.names]
    in_time = [one for one in found if one.form == "pulses"]
    assert sum(len(one.values) for one in in_time) >= 10
    wanted = Verdict.HAPPENED if equal else Verdict.AMBIGUOUS
    assert {one.verdict for one in in_time} == {wanted}
    assert all(("stretches of time would be needed" in one.text) is not equal for one in in_time)
