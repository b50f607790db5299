"""Cutting the turn out of a trace: angles, edges, feed, holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import TraceError
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.analysis import figures
from dbbstation.trace.cut import (
    FEED_TOLERANCE,
    PIECES,
    SHAPE_ORDER,
    _slopes,
    cut,
    edges_of,
    lost_on_turn,
    overlap_feed,
)
from dbbstation.trace.recording import Recording, means

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
RATE_HZ = 100.0


def shape(theta_deg):
    """What the machine does wrong in this test, by angle [mm]."""
    theta = np.radians(theta_deg)
    return 0.05 * np.cos(theta) - 0.03 * np.sin(2 * theta) + 0.004 * np.cos(5 * theta)


def trace(circle=CIRCLE, dwell_s=0.3, feed=None, noise_mm=0.0, seed=0, rate_hz=RATE_HZ, size=1.0):
    feed = feed or circle.feed_mm_min
    turning = np.degrees(feed / 60 / circle.radius_mm)
    feeding_s, arc_s = circle.feed_in_mm / (feed / 60), circle.swept_deg / turning
    t = np.arange(0, 2 + 2 * feeding_s + 2 * dwell_s + arc_s, 1 / rate_hz)
    start = 1 + feeding_s + dwell_s
    phi = np.clip((t - start) * turning, 0, circle.swept_deg) - circle.overshoot_deg
    outside = np.interp(t, [1, 1 + feeding_s], [1, 0]) + np.interp(
        t, [start + arc_s + dwell_s, start + arc_s + dwell_s + feeding_s], [0, 1]
    )
    length = circle.bar_mm + circle.feed_in_mm * outside + size * shape(circle.theta_deg(phi))
    noise = np.random.default_rng(seed).normal(0, noise_mm, len(t))
    return Recording("a run", t, length + noise)


@pytest.mark.parametrize("direction", list(Direction))
@pytest.mark.parametrize("dwell_s", [0.0, 0.3, 2.0])
def test_angles_are_right_whatever_the_corners_take(direction, dwell_s):
    circle = replace(CIRCLE, direction=direction, start_deg=20)
    raw = cut(trace(circle, dwell_s, noise_mm=0.0005), circle)
    assert len(raw) == pytest.approx(360 / circle.turning_deg_s * RATE_HZ, abs=1.5)
    assert np.std(raw.length_mm - 150 - shape(raw.theta_deg)) < 0.0006


def test_rows_with_angles_are_used_as_they_are():
    theta = np.arange(0, 360, 1.0)
    recording = Recording("a run", np.arange(360.0), 150 + shape(theta + 720), theta + 720)
    raw = cut(recording, CIRCLE)
    assert np.allclose(raw.theta_deg, theta)


@pytest.mark.parametrize("extra_deg", [0.0, 0.3])
def test_recorded_angles_keep_their_order_where_a_turn_begins_and_ends(extra_deg):
    """A turn that ends with a sample at its full 360 degrees, or 0.3 degrees later, has 720 places and counts each once."""
    phi = np.arange(-extra_deg, 360.0 + extra_deg + 1e-9, 0.5)
    theta = CIRCLE.theta_deg(phi)
    recording = Recording("a run", np.arange(float(len(theta))), 150 + shape(theta), theta % 360)
    raw = cut(recording, CIRCLE)
    assert np.allclose(raw.phi_deg, phi[(phi >= 0.0) & (phi < 360.0)])
    assert len(raw) == 720
    assert np.all(np.diff(raw.phi_deg) > 0)


def test_a_turn_that_begins_early_stays_whole():
    phi = np.arange(-0.3, 359.3, 0.5)
    theta = CIRCLE.theta_deg(phi)
    raw = cut(Recording("a run", np.arange(float(len(theta))), 150 + shape(theta), theta % 360), CIRCLE)
    assert np.allclose(raw.phi_deg, phi)


@pytest.mark.parametrize("direction", list(Direction))
@pytest.mark.parametrize("wrapped", [False, True])
def test_places_that_are_passed_twice_count_once(direction, wrapped):
    """Angles from 45 degrees before the turn to 45 behind it: the second half of a whole wave would shift centre and mean."""
    circle = replace(CIRCLE, direction=direction, start_deg=20.0)
    phi = np.arange(-45.0, 405.0, 0.5)
    theta = circle.theta_deg(phi)
    length = 150.0 + 0.040 * np.cos(np.radians(theta - 20.0)) - 0.005
    recording = Recording("a run", np.arange(float(len(phi))), length, theta % 360 if wrapped else theta)
    raw = cut(recording, circle)
    assert np.allclose(raw.phi_deg, np.arange(0.0, 360.0, 0.5))
    assert 1e3 * (raw.length_mm - 150).mean() == pytest.approx(-5.0, abs=1e-9)
    assert 1e3 * figures(raw).centre_mm[0] == pytest.approx(40.0 * np.cos(np.radians(20.0)), abs=0.01)


def test_more_than_a_turn_that_begins_elsewhere_gives_the_turn_in_its_middle():
    theta = np.arange(100.0, 480.0, 1.0)
    raw = cut(Recording("a run", np.arange(float(len(theta))), 150 + shape(theta), theta), CIRCLE)
    assert len(raw) == 360
    assert len(np.unique(np.round(raw.theta_deg, 6))) == 360


@pytest.mark.parametrize("feed", [800, 900, 970, 995, 1005, 1030, 1100, 1200])
def test_another_feed_is_found_and_named(feed):
    with pytest.raises(TraceError, match=r"a feed of .* plan states 1000") as refused:
        cut(trace(feed=feed, noise_mm=0.0003), CIRCLE)
    shown = float(str(refused.value).split("a feed of ")[1].split()[0])
    assert shown == pytest.approx(feed, rel=0.003 if "overlap" in str(refused.value) else 0.03)


def test_the_feed_of_good_runs_is_never_doubted():
    for seed in range(60):
        cut(trace(noise_mm=0.0005, seed=seed), CIRCLE)


@pytest.mark.parametrize("size", [1.0, 0.2])
def test_a_standstill_at_a_corner_is_no_overlap_of_another_feed(size):
    """A dwell of 0.3 s is longer than the arc of 5° that both passes share at this feed."""
    circle = replace(CIRCLE, feed_mm_min=6000, overshoot_deg=5)
    for seed in range(40):
        recording = trace(circle, noise_mm=0.0003, seed=seed, rate_hz=250.0, size=size)
        found = overlap_feed(recording, circle, edges_of(recording, circle))
        assert found is None or found[0] == pytest.approx(6000, rel=FEED_TOLERANCE)
        cut(recording, circle)


def test_a_perfect_circle_cannot_tell_its_feed_and_is_not_refused():
    recording = trace()
    inside = recording.length_mm < 150.7
    flat = replace(recording, length_mm=np.where(inside, 150 + 0.0004 * np.sin(7 * recording.t_s), recording.length_mm))
    assert len(cut(flat, CIRCLE)) > 5000


def test_a_circle_without_any_error_has_any_feed():
    recording = trace()
    inside = recording.length_mm < 150.7
    exact = replace(recording, length_mm=np.where(inside, 150 + 1e-7 * np.sin(recording.t_s), recording.length_mm))
    assert len(cut(exact, CIRCLE)) > 5000


def test_a_compensated_circle_with_little_shape_is_not_refused():
    recording = trace()
    inside = recording.length_mm < 150.7
    wander = 0.0005 * np.sin(0.23 * recording.t_s) + np.random.default_rng(1).normal(0, 0.0003, len(recording))
    flat = replace(recording, length_mm=np.where(inside, 150 + wander, recording.length_mm))
    assert len(cut(flat, CIRCLE)) > 5000


def test_feed_in_missing():
    recording = trace()
    late = recording.t_s > 3
    with pytest.raises(TraceError, match="no feed-in found"):
        cut(Recording("a run", recording.t_s[late], recording.length_mm[late]), CIRCLE)


def test_a_gauge_that_counts_the_wrong_way_round_is_named():
    recording = trace()
    with pytest.raises(TraceError, match="makes it shorter, not longer") as caught:
        cut(replace(recording, length_mm=300.0 - recording.length_mm), CIRCLE)
    assert "turn its counting direction" in caught.value.remedy


def test_feed_out_missing():
    recording = trace()
    early = recording.t_s < 40
    with pytest.raises(TraceError, match="no feed-out found"):
        cut(Recording("a run", recording.t_s[early], recording.length_mm[early]), CIRCLE)


def test_half_a_circle_is_refused():
    short = replace(CIRCLE, overshoot_deg=-90)
    with pytest.raises(TraceError, match=r"only 18[0-9] of 450 degrees"):
        cut(trace(short), CIRCLE)


def test_a_hole_is_named_where_it_is():
    recording = trace()
    keep = np.abs(recording.t_s - 30) > 2
    with pytest.raises(TraceError, match=r"no sample over 25.* degrees"):
        cut(Recording("a run", recording.t_s[keep], recording.length_mm[keep]), CIRCLE)


def test_samples_that_the_instrument_called_bad_are_left_out():
    recording = trace()
    spoilt = recording.length_mm.copy()
    spoilt[3000] += 0.5
    usable = np.ones(len(spoilt), dtype=bool)
    usable[3000] = False
    raw = cut(replace(recording, length_mm=spoilt, usable=usable), CIRCLE)
    assert np.abs(raw.length_mm - 150).max() < 0.1


def test_a_ball_that_left_its_seat_is_refused():
    recording = trace()
    spoilt = recording.length_mm + np.where((recording.t_s > 30) & (recording.t_s < 30.5), -0.9, 0.0)
    with pytest.raises(TraceError, match=r"jumps by 0\.\d* mm from one sample to the next, at 1\d\d\.\d degrees"):
        cut(replace(recording, length_mm=spoilt), CIRCLE)


@pytest.mark.parametrize("error_mm", [-1.2, 1.2])
def test_a_machine_wrong_by_a_millimetre_is_cut_all_the_same(error_mm):
    recording = trace(noise_mm=0.0005)
    raw = cut(replace(recording, length_mm=recording.length_mm + error_mm), CIRCLE)
    assert np.std(raw.length_mm - 150 - error_mm - shape(raw.theta_deg)) < 0.0006


def test_a_bar_of_another_length_is_refused():
    recording = trace()
    with pytest.raises(TraceError, match=r"mm off the bar's 150 mm") as refused:
        cut(replace(recording, length_mm=recording.length_mm + 5.0), CIRCLE)
    assert (
        "if the machine itself errs so much: raise feed_in_mm, or begin with a coarse calibration"
        in refused.value.remedy
    )


@pytest.mark.parametrize("feed_in_mm", [0.0, 1.5])
def test_with_recorded_angles_a_machine_may_be_off_as_far_as_a_bar_reaches(feed_in_mm):
    theta = np.arange(0, 360, 1.0)
    circle = replace(CIRCLE, feed_in_mm=feed_in_mm)
    off = 9.5 * np.cos(np.radians(theta))
    assert np.allclose(cut(Recording("a run", theta, 150 + off, theta), circle).length_mm, 150 + off)
    with pytest.raises(TraceError, match="mm off the bar's 150 mm"):
        cut(Recording("a run", theta, 150 + off * 1.1, theta), circle)


def test_loss_that_the_line_counted_is_named_before_the_feed():
    recording, circle = trace(feed=970, noise_mm=0.0003), CIRCLE
    with pytest.raises(TraceError) as alone:
        cut(recording, circle)
    assert alone.value.what.startswith(("its ", "the overlap shows"))
    with pytest.raises(TraceError) as counted:
        cut(recording, circle, counted_lost=5)
    assert counted.value.what.startswith("5 of ")
    assert counted.value.what.endswith(alone.value.what)
    assert counted.value.remedy.index("cable") < counted.value.remedy.index("set the override")


def test_slopes_of_an_overlap_are_those_of_the_fitted_polynomial():
    t = np.sort(np.random.default_rng(3).uniform(20.0, 27.0, 700))
    piece = np.arange(len(t)) * PIECES // len(t)
    slope_of = _slopes(t, piece)
    for values in (0.05 * np.cos(0.4 * t), 150.0 + 0.01 * (t - 23.0) ** 3 + 1e-4 * np.sin(50.0 * t)):
        direct = np.polynomial.Polynomial.fit(t, values, SHAPE_ORDER).deriv()(t)
        assert slope_of(values)[0] == pytest.approx(means(direct, piece), abs=1e-9)


def test_a_turn_is_cut_out_once_and_another_circle_anew():
    recording = trace()
    assert cut(recording, CIRCLE) is cut(recording, CIRCLE)
    assert cut(recording, replace(CIRCLE, start_deg=20)).circle.start_deg == 20


def test_samples_that_cannot_be_used_move_neither_edges_nor_feed():
    whole = trace(noise_mm=0.0003)
    length, usable = whole.length_mm.copy(), np.ones(len(whole), dtype=bool)
    for place in (20, 60, 900, len(whole) // 2, len(whole) - 700, len(whole) - 30):
        length[place] -= 100.0
        usable[place] = False
    damaged = replace(whole, length_mm=length, usable=usable)
    good, raw = cut(whole, CIRCLE), cut(damaged, CIRCLE)
    lost, _, unusable = lost_on_turn(damaged, CIRCLE)
    assert lost == unusable == len(good) - len(raw)
    assert np.isin(raw.t_s, good.t_s).all()
    assert raw.phi_deg == pytest.approx(good.phi_deg[np.isin(good.t_s, raw.t_s)], abs=1e-5)
    found = overlap_feed(damaged, CIRCLE, edges_of(damaged, CIRCLE))
    assert found is not None
    assert found[0] == pytest.approx(1000.0, abs=6.0 * found[1])


def test_a_recording_of_which_nothing_can_be_used_is_refused_in_words():
    whole = trace()
    with pytest.raises(TraceError, match="no sample of it can be used"):
        cut(replace(whole, usable=np.zeros(len(whole), dtype=bool)), CIRCLE)
