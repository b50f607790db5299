"""Verdicts from probability, standard deviations and held-out gains: the table of `verdict`, row by row."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest

from dbbstation.facts.value import Value
from dbbstation.inference.levels import (
    ABSENT,
    PARTS_WITH_GAIN,
    SURE,
    DensityGains,
    Gains,
    Verdict,
    is_worse,
)

GAIN, NO_GAIN = Gains((1.0,) * 10), Gains((0.0,) * 10)


def test_tokens_and_their_order():
    assert [str(one) for one in Verdict] == [
        "identified",
        "happened",
        "does-not-predict",
        "ambiguous",
        "not-testable",
        "ruled-out",
    ]
    assert [one.rank for one in Verdict] == list(range(6))


@pytest.mark.parametrize(
    ("parts", "predicts"),
    [
        ((1.0,) * 7 + (-2.0,) * 3, False),  # seven of ten, but no gain in sum without the best: 6 - 6
        ((1.0,) * 7 + (-1.9,) * 3, True),
        ((1.0,) * 6 + (0.0,) * 4, False),  # six of ten
        ((0.1,) * 9 + (-1.0,), False),
        ((100.0,) + (0.01,) * 6 + (-0.05,) * 3, False),  # one part alone carries it
        ((1.0,) * 4 + (0.0,), True),  # four of five; 3.5 are needed
        ((1.0,) * 3 + (0.0,) * 2, False),
        ((0.0,) * 10, False),
        ((), False),
        ((1.0,), False),
    ],
)
def test_what_predicts(parts, predicts):
    assert Gains(parts).predicts is predicts


@pytest.mark.parametrize(
    ("parts", "predicts"),
    [
        ((9.0, 3.0), True),  # ln 19 is 2.94
        ((9.0, 2.9), False),
        (
            (20.0, 9.0, 2.0, 1.0, -0.1, -0.2, -0.3, -0.4, 0.0, 0.0),
            True,
        ),  # four of ten, and 11 in log density without the best
        ((0.2,) * 10, False),  # ten of ten, and 1.8
        ((), False),
    ],
)
def test_what_predicts_by_density(parts, predicts):
    assert DensityGains(parts).predicts is predicts


def test_an_effect_without_use_seldom_predicts(rng):
    """Of signs by chance seven of ten or more are gains in 17.2 % (binomial); less than that are gains without the best, too."""
    drawn = [Gains(tuple(parts)).predicts for parts in rng.standard_normal((4000, 10))]
    enough = sum(comb(10, k) for k in range(7, 11)) / 2**10
    assert 0.5 * enough < np.mean(drawn) < enough + 3.0 * np.sqrt(enough / 4000)


def test_worse_is_what_can_be_seen():
    assert is_worse(8.6, 2.0)
    assert not is_worse(2.0, 8.6)
    assert not is_worse(2.001, 2.0)
    assert is_worse(2.01, 2.0)


def test_the_larger_uncertainty_holds():
    value = Value(1.0, 0.2, "mm")
    assert value.at_least(0.3) == Value(1.0, 0.3, "mm")
    assert value.at_least(0.1) is value
    assert value.at_least(float("nan")) is value
    assert np.isnan(Value(1.0, float("nan"), "mm").at_least(0.3).uncertainty)


def test_what_is_ruled_out_is_as_sure_as_what_is_there():
    assert pytest.approx(1.0 - SURE) == ABSENT
    assert 0.5 < PARTS_WITH_GAIN < 1.0
