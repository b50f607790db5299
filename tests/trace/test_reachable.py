"""Lengths that the feed allows: what a machine can do passes, what a damaged digit makes does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.reachable import AGREEING, OVERRIDE, SUDDEN_MM, UNDULATIONS, Reachable
from dbbstation.virtual.machine import circle_path

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
RAISED = replace(CIRCLE, elevation_deg=40.0, centre_mm=(0.0, 0.0, 150.0 * float(np.sin(np.radians(40.0)))))


def doubted(circle, t_s, length_mm, *, on_turn):
    reachable = Reachable(circle)
    pairs = zip(t_s.tolist(), length_mm.tolist(), strict=True)
    return np.array([bool(reachable.doubt(t, length, on_turn=on_turn)) for t, length in pairs])


@pytest.mark.parametrize("circle", [CIRCLE, RAISED], ids=["level", "raised"])
@pytest.mark.parametrize("rate_hz", [14.0, 250.0])
@pytest.mark.parametrize("off_mm", [(0.0, 0.0, 0.0), (0.8, -0.5, 0.3)], ids=["true", "off"])
def test_no_path_at_the_greatest_override_is_doubted(circle, rate_hz, off_mm) -> None:
    fast = circle_path(replace(circle, feed_mm_min=OVERRIDE * circle.feed_mm_min))
    t_s = np.arange(0.0, fast.duration_s, 1.0 / rate_hz)
    tip = np.column_stack([np.interp(t_s, fast.t_s, fast.poses[:, axis]) for axis in range(3)])
    length = np.linalg.norm(tip - np.array(circle.ball_mm) - np.array(off_mm), axis=1)
    assert not doubted(circle, t_s, length, on_turn=False).any()


@pytest.mark.parametrize("rate_hz", [8.0, 14.0, 250.0, 4000.0])
@pytest.mark.parametrize("seed", range(3))
def test_no_error_within_the_feed_in_is_doubted_on_the_turn(rate_hz, seed) -> None:
    dice = np.random.default_rng(seed)
    phi = np.arange(0.0, 2.0 * np.pi, 1e-3)
    order = np.arange(1, UNDULATIONS + 1)
    cosines, sines = dice.normal(size=(2, UNDULATIONS))
    curve = np.cos(np.outer(phi, order)) @ cosines + np.sin(np.outer(phi, order)) @ sines
    scale = CIRCLE.feed_in_mm / np.abs(curve).max()
    t_s = np.arange(0.0, 40.0, 1.0 / rate_hz)
    angle = t_s * OVERRIDE * np.radians(CIRCLE.turning_deg_s)
    length = 150.0 + scale * (np.cos(np.outer(angle, order)) @ cosines + np.sin(np.outer(angle, order)) @ sines)
    noise = dice.uniform(-SUDDEN_MM / 2.0, SUDDEN_MM / 2.0, len(t_s))
    assert not doubted(CIRCLE, t_s, length + noise, on_turn=True).any()


@pytest.mark.parametrize("off_mm", [-100.0, -0.2, 0.1, 0.5])
def test_one_reading_that_cannot_be_is_doubted_and_its_neighbours_are_not(off_mm) -> None:
    t_s = np.arange(100) / 14.0
    length = 150.0 + 0.03 * np.cos(0.1 * t_s)
    length[50] += off_mm
    assert np.flatnonzero(doubted(CIRCLE, t_s, length, on_turn=True)).tolist() == [50]


def test_moments_that_are_not_known_leave_room() -> None:
    """A display that may take its length up to 51 ms after the request: two readings are 51 ms further apart than they look."""
    u_s = 0.051 / np.sqrt(12.0)
    for about, doubted_ in ((0.0, True), (u_s, False)):
        reachable = Reachable(CIRCLE)
        reachable.note(10.0, 150.0, about)
        # 0.074 s by the stamps, 0.125 s at most: 1.2 x 16.67 mm/s x 0.125 s = 2.5 mm.
        assert bool(reachable.doubt(10.074, 152.4, about, on_turn=False)) is doubted_


def test_what_is_said_has_the_step_and_what_was_possible() -> None:
    reachable = Reachable(CIRCLE)
    assert reachable.doubt(10.0, 150.0, on_turn=True) == ""
    # 3 undulations of 1.5 mm at 1000 mm/min on a radius of 150 mm, 20 % faster: 0.6 mm/s, and 0.05 mm at once.
    assert reachable.doubt(10.1, 150.2, on_turn=True) == "+0.2000 mm within 100 ms, at the feed 0.1100 mm are possible"


def test_a_bar_that_was_moved_is_believed_after_three_readings() -> None:
    t_s = np.arange(100) / 14.0
    length = np.where(np.arange(100) < 50, 150.0, 150.8)
    assert np.flatnonzero(doubted(CIRCLE, t_s, length, on_turn=True)).tolist() == [50, 51][: AGREEING - 1]


def test_damaged_readings_in_a_row_that_differ_are_all_doubted() -> None:
    t_s = np.arange(20) / 14.0
    length = np.full(20, 150.0)
    length[8:13] = [50.0, 15.0, 151.0, 1.5, 50.1]
    assert np.flatnonzero(doubted(CIRCLE, t_s, length, on_turn=True)).tolist() == [8, 9, 10, 11, 12]


@pytest.mark.parametrize("place", [0, 1, 50, 99])
def test_a_damaged_reading_of_a_bar_that_stands_is_left_out(place) -> None:
    readings = 150.0003 + np.random.default_rng(28).normal(0.0, 2e-4, 100)
    readings[place] += 0.09
    assert np.flatnonzero(~Reachable.standing(readings)).tolist() == [place]


def test_a_bar_that_slipped_on_its_calibrator_is_not_hidden() -> None:
    readings = np.where(np.arange(100) < 40, 150.0003, 150.1003)
    assert np.count_nonzero(~Reachable.standing(readings)) <= 2 * (AGREEING - 1)
    assert np.ptp(readings[Reachable.standing(readings)]) > 0.09
