"""Coefficients and low-pass of whole periods against sums and least squares written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.inference import harmonics
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import WORST_CONDITION, amplitudes, basis, coefficients, smooth, smooth_of


def written_out(phase, highest):
    """Constant, cosines and sines of mean square one, each computed by itself."""
    waves = [np.ones(len(phase))]
    waves += [np.sqrt(2.0) * np.cos(k * phase) for k in range(1, highest + 1)]
    waves += [np.sqrt(2.0) * np.sin(k * phase) for k in range(1, highest + 1)]
    return np.column_stack(waves)


def about_even(count, seed):
    rng = np.random.default_rng(seed)
    return 2.0 * np.pi * (np.arange(count) + rng.uniform(0.0, 0.5, count)) / count, rng.normal(size=count)


@pytest.mark.parametrize(("count", "highest"), [(75, 25), (720, 240), (5000, 240), (64, 1), (64, 16), (64, 15)])
def test_coefficients_are_the_sums(count, highest):
    phase, values = about_even(count, 1)
    direct = written_out(phase, highest)
    assert np.abs(basis(phase, highest) - direct).max() < 1e-12  # millions of numbers: pytest.approx takes seconds
    assert coefficients(values, phase, highest) == pytest.approx(direct.T @ values / np.sqrt(count), abs=1e-11)


def test_coefficients_of_several_at_once():
    phase, values = about_even(500, 2)
    three = np.column_stack([values, values**2, np.cos(values)])
    together = coefficients(three, phase, 40)
    assert together.shape == (81, 3)
    for k in range(3):
        assert together[:, k] == pytest.approx(coefficients(three[:, k], phase, 40), abs=1e-12)


@pytest.mark.parametrize(("count", "highest"), [(75, 18), (720, 30), (5000, 30), (64, 1)])
def test_low_pass_is_least_squares(count, highest):
    phase, values = about_even(count, 3)
    columns = written_out(phase, highest)
    fitted, *_ = np.linalg.lstsq(columns, values, rcond=None)
    assert smooth(values, phase, highest) == pytest.approx(columns @ fitted, abs=1e-10)


@pytest.mark.parametrize(("share", "highest", "ill"), [(0.9, 5, False), (0.9, 12, False), (0.5, 5, True)])
def test_low_pass_of_a_part_of_the_period_is_least_squares_too(share, highest, ill):
    phase, values = about_even(1000, 4)
    kept = phase < 2.0 * np.pi * share
    columns = written_out(phase[kept], highest)
    assert (np.linalg.cond(columns.T @ columns) > WORST_CONDITION) == ill
    fitted, *_ = np.linalg.lstsq(columns, values[kept], rcond=None)
    assert smooth(values[kept], phase[kept], highest) == pytest.approx(columns @ fitted, abs=1e-8)
    three = [values[kept], values[kept] ** 2, np.cos(values[kept])]
    fitted, *_ = np.linalg.lstsq(columns, np.column_stack(three), rcond=None)
    assert np.column_stack(smooth_of(three, phase[kept], highest)) == pytest.approx(columns @ fitted, abs=1e-8)
    assert smooth_of([], phase[kept], highest) == []


@pytest.mark.parametrize("count", [50, BOUNDS.samples_at_once, 2 * BOUNDS.samples_at_once + 1])
@pytest.mark.parametrize("share", [1.0, 0.4])
def test_amplitudes_are_those_that_values_were_made_of(count, share):
    phase = np.linspace(0.0, 2.0 * np.pi * share, count, endpoint=False)
    values = 3.0 + 2.0 * np.cos(phase) - 1.0 * np.sin(phase) + 0.5 * np.cos(3.0 * phase - np.radians(40.0))
    expected = [3.0, 2.0 + 1.0j, 0.0, 0.5 * np.exp(-1j * np.radians(40.0)), 0.0]
    assert amplitudes(values, phase, 4) == pytest.approx(np.array(expected), abs=1e-9 if share == 1.0 else 1e-6)


@pytest.mark.parametrize("at_once", [3, 8, 32])
def test_how_many_harmonics_are_made_at_once_decides_nothing(rng, monkeypatch, at_once):
    phase, values = np.sort(rng.uniform(0.0, 2.0 * np.pi, 900)), rng.normal(size=900)
    before = coefficients(values, phase, 61), smooth(values, phase)
    monkeypatch.setattr(harmonics, "BOUNDS", replace(BOUNDS, harmonics_at_once=at_once))
    np.testing.assert_allclose(coefficients(values, phase, 61), before[0], atol=1e-12)
    np.testing.assert_allclose(smooth(values, phase), before[1], atol=1e-12)


@pytest.mark.parametrize("gap_deg", [12.0, 30.0, 45.0])
def test_where_normal_equations_give_way_to_the_basis_decides_nothing(rng, monkeypatch, gap_deg):
    """Phases that leave a part of the period out: both ways to the same least squares, to 1e-5 of the noise."""
    phase = np.sort(rng.uniform(np.radians(gap_deg), 2.0 * np.pi, 2000))
    values = np.cos(3.0 * phase) + 0.1 * rng.normal(size=2000)
    found = []
    for worst in (0.0, 1e12):
        monkeypatch.setattr(harmonics, "WORST_CONDITION", worst)
        found.append(smooth(values, phase))
    np.testing.assert_allclose(*found, atol=1e-6)
