"""Forms of curves, against what their definition says."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.forms import BehindReversal, Walk, Wave


def test_a_walk_has_the_covariance_of_a_random_walk():
    """At its own points: the lesser of both times, in its unit [Wiener process]."""
    at = np.array([0.0, 3.0, 4.0, 10.0])
    columns = Walk(at, 2.0).columns(at)
    assert columns @ columns.T == pytest.approx(np.minimum.outer(at, at) / 2.0)


def test_what_stays_behind_is_against_the_new_direction_and_ends(rng):
    form, heights = BehindReversal(16.0, 5), rng.normal(size=5)
    way = np.linspace(0.01, 25.0, 400)
    expected = np.interp(way, [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0], [0.0, *heights, 0.0], right=0.0)
    assert form.columns(way) @ heights == pytest.approx(-expected)
    assert form.columns(-way) @ heights == pytest.approx(expected)
    assert not form.columns(np.zeros(1)).any()


def test_a_wave_has_its_multiples():
    at = np.linspace(-3.0, 8.0, 200)
    phase = 2.0 * np.pi * 0.3 * at
    expected = [
        np.cos(phase),
        np.sin(phase),
        np.cos(2.0 * phase),
        np.sin(2.0 * phase),
        np.cos(3.0 * phase),
        np.sin(3.0 * phase),
    ]
    assert Wave(0.3, 3).columns(at) == pytest.approx(np.column_stack(expected))
    assert Wave(0.3, 3).text("mm") == "period 3.33333 mm and 2 harmonics"
