"""The Gaussian filter of closed profiles against its defining equation."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.trace.gaussian import gaussian

THETA = np.arange(0.0, 360.0, 0.1)


def passed(undulations, cut_off, theta=THETA):
    wave = np.exp(1j * undulations * np.radians(theta))
    smooth = gaussian(theta, wave.real, cut_off) + 1j * gaussian(theta, wave.imag, cut_off)
    return np.mean(smooth * wave.conj()).real


@pytest.mark.parametrize("cut_off", [15, 50, 150])
def test_half_of_the_cut_off_passes(cut_off):
    assert passed(cut_off, cut_off) == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(("undulations", "cut_off"), [(1, 15), (5, 15), (30, 15), (2, 50), (100, 50), (75, 150)])
def test_transmission_follows_the_equation(undulations, cut_off):
    alpha = np.sqrt(np.log(2.0) / np.pi)
    expected = np.exp(-np.pi * (alpha * undulations / cut_off) ** 2)
    assert passed(undulations, cut_off) == pytest.approx(expected, abs=1e-3)


def test_a_convolution_by_the_weighting_function_gives_the_same():
    """ISO 16610-21: s(x) = exp(-π (x / α λ)²) / (α λ), summed over the turn and its neighbours."""
    rng = np.random.default_rng(1)
    theta = np.arange(0.0, 360.0, 0.5)
    values = np.cumsum(rng.normal(0.0, 1.0, len(theta)))
    alpha, length = np.sqrt(np.log(2.0) / np.pi), 360.0 / 15
    away = theta[:, None] - theta
    weight = sum(np.exp(-np.pi * ((away + 360.0 * k) / (alpha * length)) ** 2) for k in (-1, 0, 1))
    weight /= weight.sum(axis=1)[:, None]
    assert gaussian(theta, values, 15) == pytest.approx(weight @ values, abs=2e-3 * np.ptp(values))


def test_samples_that_crowd_count_by_their_arc():
    rng = np.random.default_rng(2)
    crowded = np.sort(np.concatenate([THETA, rng.uniform(40.0, 80.0, 5000)]))
    form = np.cos(2 * np.radians(crowded))
    assert gaussian(crowded, form, 50) == pytest.approx(form, abs=3e-3)
    assert gaussian(crowded, np.full(len(crowded), 7.0), 15) == pytest.approx(7.0)


def test_the_order_of_samples_does_not_matter():
    values = np.cos(3 * np.radians(THETA))
    order = np.random.default_rng(3).permutation(len(THETA))
    assert gaussian(THETA[order], values[order], 15) == pytest.approx(gaussian(THETA, values, 15)[order], abs=1e-9)
