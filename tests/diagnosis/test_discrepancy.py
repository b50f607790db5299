"""The inaccuracy of formulas: smooth functions times the effect, without the directions that noise hides."""

from __future__ import annotations

import numpy as np

from dbbstation.diagnosis.parts import seen_of
from dbbstation.inference.forms import modulated


def test_axes_stand_for_the_covariance_of_columns_up_to_the_least(rng):
    columns = rng.normal(size=(60, 8)) * np.array([3.0, 2.0, 1.0, 0.5, 1e-3, 1e-4, 1e-5, 1e-6])
    columns[:, 3] = columns[:, 0]
    seen = seen_of(columns, 1.0, 0.05)
    assert seen.shape == (60, 3)
    lacking = columns @ columns.T - seen @ seen.T
    assert np.linalg.eigvalsh(lacking).max() < 0.05**2
    assert seen_of(columns, 1.0, 0.0).shape[1] >= 7
    assert seen_of(columns, 0.2, 0.01).shape == seen.shape
    assert seen_of(np.zeros((60, 0)), 1.0, 0.05).shape == (60, 0)


def test_what_is_left_out_moves_a_log_bayes_factor_by_no_more_than_half_its_square(rng):
    """A direction of a tenth of a standard deviation: at most 0.005, by the determinants of the covariances."""
    noise, least = 0.4, 0.04
    columns = rng.normal(size=(60, 5)) @ np.diag([0.3, 0.1, 0.004, 0.003, 0.002])
    seen = seen_of(columns, 1.0, least)
    left_out = columns.shape[1] - seen.shape[1]
    whole, less = (np.linalg.slogdet(np.eye(60) + each @ each.T / noise**2)[1] for each in (columns, seen))
    assert left_out == 3
    assert 0.0 <= 0.5 * (whole - less) <= 0.005 * left_out


def left_rms(effect, along, departure, *, each_side):
    columns = modulated([effect[:, None]], [along[:, None]], None, each_side=each_side)
    return np.std(departure - columns @ np.linalg.lstsq(columns, departure, rcond=None)[0])


def test_contacts_stiffen_on_either_side_of_zero_force():
    """Elastic struts of 8 µm/kN whose contacts stiffen by a third over 1 kN, as in the simulated robots."""
    force_n = np.linspace(-700.0, 1100.0, 400)
    effect_um = 8e-3 * force_n
    departure_um = effect_um * 0.33 * (1e3 - np.abs(force_n)) / (1e3 + np.abs(force_n))
    assert left_rms(effect_um, force_n, departure_um, each_side=False) > 0.04
    assert left_rms(effect_um, force_n, departure_um, each_side=True) < 0.004


def test_a_lag_may_differ_with_the_direction():
    speed_mm_s = np.linspace(-12.0, 9.0, 300)
    departure_mm = 0.25e-3 * np.abs(speed_mm_s)
    assert left_rms(1e-3 * speed_mm_s, speed_mm_s, departure_mm, each_side=False) > 1e-4
    assert left_rms(1e-3 * speed_mm_s, speed_mm_s, departure_mm, each_side=True) < 1e-9


def test_variables_of_one_sign_have_one_side():
    length_mm, effect_mm = np.linspace(500.0, 700.0, 50)[:, None], np.linspace(1.0, 2.0, 50)[:, None]
    whole, sides = (modulated([effect_mm], [length_mm], None, each_side=each) for each in (False, True))
    assert np.array_equal(whole, sides)
