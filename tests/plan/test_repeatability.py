"""Scatter of a holder against closed forms, published quantiles and simulated mountings."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.plan.repeatability import repeatability, scatter


def test_two_mountings_by_hand():
    """Centres 2 µm apart along x: mean in between, 1 + 1 = 2 µm² for one degree of freedom."""
    found = repeatability([np.array([[0.0, 5.0, 7.0], [2.0, 5.0, 7.0]])])
    assert [axis.s_um for axis in found.axes.values()] == pytest.approx([np.sqrt(2.0), 0.0, 0.0])
    assert found.together.s_um == pytest.approx(np.sqrt(2.0 / 3.0))
    assert (found.axes["x"].degrees_of_freedom, found.together.degrees_of_freedom, found.places, found.mountings) == (
        1,
        3,
        1,
        2,
    )
    assert found.rms_distance_um == pytest.approx(np.sqrt(2.0))


def test_the_interval_of_ten_mountings_is_that_of_tables():
    """Chi-square with 9 degrees of freedom: 2.700 and 19.023 at 2.5 % and 97.5 % [any table]."""
    found = scatter(9.0, 9)
    assert found.s_um == 1.0
    assert found.low_um == pytest.approx(np.sqrt(9.0 / 19.023), rel=1e-4)
    assert found.high_um == pytest.approx(np.sqrt(9.0 / 2.700), rel=1e-4)
    assert found.standard_uncertainty_um == pytest.approx(1.0 / np.sqrt(18.0))


def test_places_do_not_have_to_be_where_they_were_meant():
    rng = np.random.default_rng(1)
    places = [rng.normal(0, 1, (10, 3)) for _ in range(3)]
    moved = [place + 100.0 * k for k, place in enumerate(places)]
    assert repeatability(moved).together.s_um == pytest.approx(repeatability(places).together.s_um)


def test_what_the_paper_states_is_a_distance_of_the_holders_in_use():
    """[CAL III-B]: 1.0 and 3.2 µm, ten mountings. Shipped plates state 0.58 and 1.85 µm per axis: 1.0 and 3.2 over sqrt(3)."""
    rng = np.random.default_rng(2)
    for per_axis, stated in ((0.58, 1.0), (1.85, 3.2)):
        found = repeatability([rng.normal(0, per_axis, (10, 3)) for _ in range(2000)])
        assert found.rms_distance_um == pytest.approx(stated, rel=0.01)
        # Mean length of a normal vector in space: sigma sqrt(8 / pi).
        assert found.mean_distance_um == pytest.approx(per_axis * np.sqrt(8.0 / np.pi), rel=0.01)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    trials = 2000
    inside = axes = 0
    for _ in range(trials):
        found = repeatability([rng.normal(0, 1.3, (10, 3)) for _ in range(2)])
        inside += found.together.low_um <= 1.3 <= found.together.high_um
        axes += found.axes["x"].low_um <= 1.3 <= found.axes["x"].high_um
    # Three standard deviations of a binomial count at 95 %.
    assert abs(inside / trials - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / trials)
    assert abs(axes / trials - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / trials)


def test_axes_that_scatter_alike_are_called_different_as_rarely_as_stated():
    rng = np.random.default_rng(4)
    alarms = sum(repeatability([rng.normal(0, 1, (10, 3)) for _ in range(3)]).p_axes_alike < 0.01 for _ in range(2000))
    assert alarms / 2000 < 0.01 + 3.0 * np.sqrt(0.01 * 0.99 / 2000)
    unlike = repeatability([rng.normal(0, 1, (10, 3)) * [1.0, 1.0, 4.0] for _ in range(3)])
    assert unlike.p_axes_alike < 1e-6


def test_the_cmm_is_taken_off():
    rng = np.random.default_rng(5)
    found = repeatability([rng.normal(0, 1, (10, 3)) + rng.normal(0, 0.5, (10, 3)) for _ in range(500)], cmm_um=0.5)
    assert found.together.s_um == pytest.approx(1.0, rel=0.02)
    assert repeatability([rng.normal(0, 0.1, (10, 2))], cmm_um=5.0).together.s_um == 0.0


def test_one_mounting_shows_no_scatter():
    with pytest.raises(ValueError, match="one mounting only"):
        repeatability([np.zeros((1, 3))])
    same = repeatability([np.zeros((3, 3))])
    assert (same.together.s_um, same.p_axes_alike) == (0.0, 1.0)
