"""Curves of thermometers: exact where they show everything, within half a step where they round."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.trace.recording import logged_curve

BEGUN_S = np.cumsum(np.tile([130.0, 70.0, 400.0], 12))


def swing(time_s):
    return 21.0 + 1.2 * np.sin(2 * np.pi * time_s / 5400.0)


def runs(step=0.0, begun_s=BEGUN_S):
    times = [begun + np.linspace(0.0, 40.0, 81) for begun in begun_s]
    return [(t, step * np.round(swing(t) / step) if step else swing(t)) for t in times]


def test_fine_thermometers_are_followed_as_they_are():
    time_s, degc = logged_curve(runs())
    assert len(time_s) == 2 * len(BEGUN_S)
    assert np.allclose(degc, swing(time_s), atol=1e-4)  # means of twenty seconds of a curve


def bending(time_s, degc):
    return np.mean(np.gradient(np.gradient(degc, time_s), time_s) ** 2)


@pytest.mark.parametrize("step", [0.1, 0.5])
def test_coarse_ones_are_within_half_a_step_of_what_they_show(step):
    time_s, degc = logged_curve(runs(step))
    shown = np.array([half.mean() for _, one in runs(step) for half in np.array_split(one, 2)])
    assert np.abs(degc - shown).max() <= 0.5 * step * (1 + 1e-9)
    assert bending(time_s, degc) < 0.5 * bending(time_s, shown)


def test_slow_ones_come_closer_to_the_truth_than_what_they_show():
    def warming(time_s):
        return 21.0 - 0.6 * np.expm1(-time_s / 2400.0)

    rounded = [(t, 0.1 * np.round(warming(t) / 0.1)) for t, _ in runs()]
    time_s, degc = logged_curve(rounded)
    shown = np.array([half.mean() for _, one in rounded for half in np.array_split(one, 2)])
    off, was = (np.sqrt(np.mean((values - warming(time_s)) ** 2)) for values in (degc, shown))
    assert was == pytest.approx(0.1 / np.sqrt(12), rel=0.2)
    assert off < 0.5 * was


@pytest.mark.parametrize("count", [1, 2])
def test_few_runs_are_enough(count):
    time_s, degc = logged_curve(runs(0.1, BEGUN_S[:count]))
    assert len(time_s) == len(degc) == 2 * count
    assert np.abs(degc - swing(time_s)).max() < 0.05 + 1e-3


def test_a_thermometer_that_never_moves_is_level():
    time_s, degc = logged_curve([(t, np.full_like(t, 20.0)) for t, _ in runs()])
    assert np.array_equal(degc, np.full_like(time_s, 20.0))


def test_what_is_logged_once_a_run_is_not_taken_for_coarse():
    shown = [20.00, 21.31, 23.17, 22.05]
    _, degc = logged_curve([(t, np.full_like(t, value)) for (t, _), value in zip(runs(), shown, strict=False)])
    assert np.allclose(degc, np.repeat(shown, 2), atol=0.005 + 1e-9)


def test_runs_of_a_clock_that_was_set_back_still_rise():
    begun_s = np.array([0.0, 100.0, 80.0, 80.0, 300.0])
    time_s, degc = logged_curve(runs(0.1, begun_s))
    assert np.all(np.diff(time_s) > 0)
    assert np.abs(degc - swing(time_s)).max() < 0.06
