"""What an instrument that is slow sees of a circle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan.sampling import UNDULATIONS, sampled

CIRCLE = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml").tests["a"].circle


def test_fourteen_readings_a_second_at_a_feed_of_a_thousand() -> None:
    """A turn is 2 pi r long; at 1000 mm/min and 150 mm that are 56.5 s and 792 readings."""
    circle = replace(CIRCLE, feed_mm_min=1000.0)
    turn_s = 2.0 * math.pi * circle.radius_mm / (1000.0 / 60.0)
    seen = sampled(circle, 14.0)
    assert seen.points_per_turn == pytest.approx(14.0 * turn_s)
    assert seen.spacing_deg == pytest.approx(360.0 / (14.0 * turn_s))
    assert seen.enough
    assert seen.is_circle


def test_what_is_not_seen_passes_for_something_slower() -> None:
    """By brute force: of n points the undulations above n/2 have the same readings as some below."""
    seen = sampled(replace(CIRCLE, feed_mm_min=20_000.0), 14.0)
    count = round(seen.points_per_turn)
    phi = 2.0 * np.pi * np.arange(count) / count
    high = count - seen.highest_undulation
    assert high >= seen.highest_undulation
    assert np.allclose(np.cos(high * phi), np.cos(seen.highest_undulation * phi))
    assert not seen.enough


def test_at_the_feed_that_is_named_the_figures_are_seen() -> None:
    quick = replace(CIRCLE, feed_mm_min=30_000.0)
    feed_mm_min = sampled(quick, 14.0).greatest_feed_mm_min
    # Readings per undulation: two, of as many undulations as figures have, on the way of one turn.
    assert feed_mm_min == pytest.approx(14.0 * 60.0 * 2.0 * math.pi * quick.radius_mm / (2 * UNDULATIONS))
    assert sampled(replace(quick, feed_mm_min=feed_mm_min * 0.999), 14.0).enough
    assert not sampled(replace(quick, feed_mm_min=feed_mm_min * 1.1), 14.0).enough


def test_few_points_are_no_circle() -> None:
    assert not sampled(replace(CIRCLE, feed_mm_min=30_000.0), 14.0).is_circle
