"""Run lengths of control charts against published tables, simulation and one another."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.history.run_length import Chart, average_run_length, chart_for
from studies.history import signalled_within


@pytest.mark.parametrize(
    ("interval", "shift", "published"),
    [
        (4.0, 0.0, 168.0),
        (4.0, 0.25, 74.2),
        (4.0, 0.5, 26.6),
        (4.0, 1.0, 8.38),
        (4.0, 2.0, 3.34),
        (4.0, 4.0, 1.71),
        (5.0, 0.0, 465.0),
        (5.0, 0.25, 139.0),
        (5.0, 0.5, 38.0),
        (5.0, 1.0, 10.4),
        (5.0, 2.0, 4.01),
        (5.0, 4.0, 2.01),
    ],
)
def test_average_run_lengths_are_those_of_the_textbook(interval, shift, published):
    """Montgomery, Introduction to Statistical Quality Control, two-sided tabular CUSUM with k = 1/2; three digits."""
    assert average_run_length(Chart(0.5, interval), shift) == pytest.approx(published, rel=5e-3)


def simulated(chart, mean, count, most, rng):
    high, low, first = np.zeros(count), np.zeros(count), np.full(count, most + 1)
    for k in range(1, most + 1):
        z = rng.normal(mean, 1.0, count)
        high, low = np.maximum(0.0, high + z - chart.reference), np.maximum(0.0, low - z - chart.reference)
        signals = (np.maximum(high, low) > chart.interval) | (np.abs(z) > chart.single)
        first = np.where(signals & (first > most), k, first)
    return first


@pytest.mark.parametrize("chart", [Chart(0.5, 3.0), Chart(0.5, 4.0, 3.0), Chart(0.25, 5.0, 3.2)])
def test_a_chart_with_a_limit_for_single_values_runs_as_long_as_simulated(chart, rng):
    first = simulated(chart, 0.0, 20_000, 2_000, rng)
    assert (first > 2_000).mean() < 1e-3
    assert average_run_length(chart) == pytest.approx(first.mean(), abs=4.0 * first.std() / np.sqrt(len(first)))


def test_the_chance_of_a_signal_by_each_value_is_as_simulated(rng):
    chart = Chart(0.5, 3.0, 2.8)
    first = simulated(chart, 0.8, 20_000, 12, rng)
    upward = signalled_within(chart, [0.8] * 12)
    downward = signalled_within(chart, [-0.8] * 12)
    either = 1.0 - (1.0 - upward) * (1.0 - downward)
    share = [(first <= k).mean() for k in range(1, 13)]
    assert either == pytest.approx(share, abs=0.015)


def test_chances_and_average_run_length_agree():
    chart = Chart(0.5, 4.0)
    still = 1.0 - signalled_within(chart, [1.0] * 400)
    assert 1.0 + still.sum() == pytest.approx(average_run_length(chart, 1.0), rel=1e-3)


@pytest.mark.parametrize("rate", [0.1, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_chart_signals_as_often_as_asked(rate, share):
    chart = chart_for(rate, single_share=share)
    assert average_run_length(chart) == pytest.approx(1.0 / rate, rel=1e-4)
