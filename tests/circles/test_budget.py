"""Terms of uncertainty against closed forms and against draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.circles.analysis import analyse, analyse_pair
from dbbstation.circles.budget import Cause, Quantity, SetUpKnowledge, budgets, pair_budgets
from dbbstation.circles.path import Filter
from tests.circles.test_analysis import CCW, CW, PHI, measured

KNOWN = SetUpKnowledge(
    u_bar_um=0.5, expansion_um_m_k=10.0, calibrated_degc=20.0, measured_degc=22.0, u_ball_um=1.2, u_ball_z_um=2.0
)


def form(theta):
    return 10.0 * np.cos(2 * theta)


def drawn(chosen, count=60, sigma_mm=5e-4):
    raw, rng = measured(form, ball_mm=(0.05, 0.02)), np.random.default_rng(8)
    return [
        analyse(replace(raw, length_mm=raw.length_mm + rng.normal(0.0, sigma_mm, len(PHI))), chosen=chosen)
        for _ in range(count)
    ]


def test_centre_and_radius_scatter_as_their_noise_term_says():
    runs = drawn(Filter.NONE)
    terms = {q: b.terms_um[Cause.NOISE] for q, b in budgets(runs[0], KNOWN).items()}
    assert 1e3 * np.std([one.centre_mm[0] for one in runs]) == pytest.approx(terms[Quantity.X], rel=0.35)
    assert 1e3 * np.std([one.centre_mm[1] for one in runs]) == pytest.approx(terms[Quantity.Y], rel=0.35)
    assert np.std([one.radius_error_um for one in runs]) == pytest.approx(terms[Quantity.RADIUS], rel=0.35)


@pytest.mark.parametrize("chosen", [Filter.UPR_15, Filter.UPR_50])
def test_filtered_g_stays_within_its_noise_and_what_noise_adds(chosen):
    """G is the range of two extremes: it scatters by no more than their noise together, and noise makes it larger."""
    runs = drawn(chosen)
    budget = budgets(runs[0], KNOWN)[Quantity.G]
    silent = analyse(measured(form, ball_mm=(0.05, 0.02)), chosen=chosen).g_um
    g = np.array([one.g_um for one in runs])
    assert np.std(g) < 1.3 * budget.terms_um[Cause.NOISE]
    assert np.std(g) > 0.3 * budget.terms_um[Cause.NOISE]
    assert 0.0 < g.mean() - silent < budget.noise_adds_um


def test_each_term_has_its_size():
    raw = replace(measured(form, ball_mm=(0.0, -0.3)), start_uncertainty_deg=0.1)
    found = budgets(analyse(raw), KNOWN)
    assert found[Quantity.RADIUS].terms_um[Cause.BAR] == 0.5
    assert found[Quantity.F].terms_um[Cause.TEMPERATURE] == pytest.approx(10.0 * 2.0 * 0.150)
    assert found[Quantity.X].terms_um[Cause.MOUNTING] == 1.2
    # A turn that begins elsewhere turns the centre: 300 µm in Y become X.
    assert found[Quantity.X].terms_um[Cause.ANGLE] == pytest.approx(300.0 * np.radians(0.1), rel=1e-3)
    assert found[Quantity.Y].terms_um[Cause.ANGLE] == pytest.approx(0.0, abs=1e-3)
    assert Cause.BAR not in found[Quantity.G].terms_um  # a longer bar makes no circle less round
    # The highest undulation that counts bends by k² A between samples: A (k Δθ)² / 8.
    between = 10.0 * (2 * np.radians(PHI[1])) ** 2 / 8.0 / np.sqrt(3.0)
    assert found[Quantity.F].terms_um[Cause.SAMPLING] == pytest.approx(between, rel=0.1)
    total = np.sqrt(sum(term**2 for term in found[Quantity.F].terms_um.values()))
    assert found[Quantity.F].u_um == pytest.approx(total)


def test_what_nobody_stated_is_named():
    found = budgets(analyse(measured(form)), SetUpKnowledge())
    assert {str(Cause.BAR), str(Cause.TEMPERATURE)} <= set(found[Quantity.F].missing)
    assert str(Cause.MOUNTING) in found[Quantity.X].missing
    assert str(Cause.BAR) not in found[Quantity.G].missing


def test_a_raised_bar_enlarges_what_the_bar_does():
    raw = measured(form, replace(CCW, elevation_deg=60))
    found = budgets(analyse(raw), KNOWN)[Quantity.RADIUS]
    assert found.terms_um[Cause.BAR] == pytest.approx(0.5 / np.cos(np.radians(60)))
    assert found.terms_um[Cause.MOUNTING] == pytest.approx(2.0 * np.tan(np.radians(60)))
    assert any("height" in cause for cause in found.missing)


def test_both_directions_share_their_bar():
    pair = analyse_pair(analyse(measured(form, CCW)), analyse(measured(form, CW)))
    found = pair_budgets(pair, KNOWN)
    assert found[Quantity.D].terms_um[Cause.BAR] == 0.5
    assert set(found) == {Quantity.G_BOTH, Quantity.D, Quantity.H}
