"""Machines unlike their sisters, against published critical values, brute force and counted false alarms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import binom

from dbbstation.sisters.unlike import held_against_sisters, unlike_machines
from tests.sisters.odd_machines import FALSE_ALARMS, counted


@pytest.mark.parametrize(("n", "critical"), [(5, 1.715), (8, 2.126), (10, 2.290), (20, 2.709), (30, 2.908)])
def test_of_one_machine_it_is_the_test_of_grubbs(n, critical):
    """Two-sided critical values at 0.05 [Grubbs and Beck 1972, Technometrics 14, 847]: (x - mean) / s of all n."""
    rest = np.linspace(-1.0, 1.0, n - 1)

    def grubbs(off):
        every = np.append(rest, off)
        return (off - every.mean()) / every.std(ddof=1)

    at = brentq(lambda off: grubbs(off) - critical, 1.0, 1000.0)
    for factor, unlike in ((0.97, False), (1.03, True)):
        every = np.append(rest, at * factor)[None]
        assert unlike_machines(every, np.full_like(every, np.nan), 0.05)[0, -1] == unlike
        assert not unlike_machines(every, np.full_like(every, np.nan), 0.05)[0, :-1].any()


def test_the_scatter_is_that_of_paule_and_mandel():
    """It solves sum((x - mean)^2 / (scatter^2 + u^2)) = n - 1, with the weighted mean; here by bisection."""
    rng = np.random.default_rng(3)
    u = rng.uniform(0.5, 3.0, 12)
    x = rng.normal(0.0, 2.0, 12) + rng.normal(0.0, u)
    held = held_against_sisters(x[None], u[None], 0.01)
    others = np.arange(12) != 4

    def excess(square):
        weight = 1.0 / (square + u[others] ** 2)
        mean = np.average(x[others], weights=weight)
        return np.sum(weight * (x[others] - mean) ** 2) - (others.sum() - 1)

    square = brentq(excess, 0.0, 100.0, xtol=1e-14)
    weight = 1.0 / (square + u[others] ** 2)
    assert held.scatter[0, 4] == pytest.approx(np.sqrt(square), rel=1e-6)
    assert held.middle[0, 4] == pytest.approx(np.average(x[others], weights=weight), rel=1e-6)


def test_machines_that_are_far_off_do_not_hide_each_other():
    rng = np.random.default_rng(5)
    every = rng.normal(0.0, 1.0, (1, 20))
    every[0, :3] = [30.0, 33.0, 31.0]
    marked = unlike_machines(every, np.full_like(every, np.nan))
    assert np.flatnonzero(marked[0]).tolist() == [0, 1, 2]


def test_a_value_that_is_known_badly_is_not_odd_for_that():
    every = np.append(np.linspace(-1.0, 1.0, 15), 12.0)[None]
    sure, unsure = np.full_like(every, 0.1), np.full_like(every, 0.1)
    unsure[0, -1] = 10.0
    assert unlike_machines(every, sure)[0, -1]
    assert not unlike_machines(every, unsure)[0, -1]


def test_two_machines_tell_nothing_and_what_is_not_known_is_left_out():
    every = np.array([[1.0, 9.0, np.nan, np.nan], [1.0, 1.1, 0.9, 50.0]])
    held = held_against_sisters(every, np.full_like(every, np.nan), 0.05)
    assert not held.unlike[0].any()
    assert np.isnan(held.score[0]).all()
    assert held.unlike[1].tolist() == [False, False, False, True]


def test_false_alarms_are_no_more_than_stated():
    """Of 100 fleets of 40 like machines with some twenty quantities each; 500 by hand, in docs/validation.md."""
    one = counted(100, 0.0, 36)
    assert one.alarmed <= binom.ppf(0.999, one.draws, FALSE_ALARMS)


def test_three_odd_machines_of_forty_are_found():
    one = counted(40, 8.0, 36)
    assert one.found >= 0.97 * one.odd
    assert one.alarmed <= binom.ppf(0.999, one.draws, FALSE_ALARMS)
