"""What is wrong with a gauge though its circles look sound: its scale, readings that come twice; and a form that no other test expects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.plan.plan import Circle, Direction
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.single import repeated
from dbbstation.trace.cut import edges_of, feeding_ways
from dbbstation.trace.recording import RawCircle, Recording
from tests.quality.sessions import finding_of, judged, run, spoilt
from tests.quality.spoilers import coming_twice, oval, scaled

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0.0, 45, 1.5, 0, Direction.CCW)


@pytest.fixture
def whole(six_tests):
    return six_tests


def trace(dwell_s: float, seed: int, noise_um: float = 0.3, rate_hz: float = 50.0) -> Recording:
    """A path as commanded about a ball that stands 0.1 mm off: feed-in, dwell, arc, dwell, feed-out, a second of standing at both ends."""
    feeding_s, arc_s = CIRCLE.feed_in_mm / (CIRCLE.feed_mm_min / 60.0), CIRCLE.swept_deg / CIRCLE.turning_deg_s
    corners = np.cumsum([1.0, feeding_s, dwell_s, arc_s, dwell_s, feeding_s, 1.0])
    t = np.arange(0.0, corners[-1], 1.0 / rate_hz)
    outside = np.interp(t, [corners[0], corners[1], corners[4], corners[5]], [1.5, 0.0, 0.0, 1.5])
    phi = np.interp(t, [corners[2], corners[3]], [-45.0, 405.0])
    length = CIRCLE.bar_mm + outside + 0.1 * np.cos(np.radians(phi - 70.0))
    return Recording("", t, length + np.random.default_rng(seed).normal(0.0, 1e-3 * noise_um, len(t)))


@pytest.mark.parametrize("dwell_s", [0.0, 0.3, 1.5])
def test_a_way_is_as_long_as_it_was_commanded(dwell_s):
    """Whatever the control waits at the corners, within four standard uncertainties, or 0.5 µm for a cosine that is no parabola."""
    for seed in range(10):
        recording = trace(dwell_s, seed)
        ways = feeding_ways(recording, CIRCLE, edges_of(recording, CIRCLE))
        assert [way.phi_deg for way in ways] == [-45.0, 405.0]
        for way in ways:
            assert abs(way.way_um - 1500.0) < 4.0 * way.u_um + 0.5
            assert 0.2 < way.u_um < 0.6


def test_a_gauge_that_counts_too_much_is_found_by_the_way_of_feed_in_and_feed_out(whole):
    first, second = run(whole, "b ccw 1"), run(whole, "b cw 1")
    sound_one = finding_of(judged([first], second), Name.SCALE)
    assert sound_one.verdict is FindingVerdict.GOOD
    assert sound_one.value < 0.5
    for percent in (2.0, -2.0):
        both = [spoilt(one, scaled, percent) for one in (first, second)]
        found = finding_of(judged(both[:1], both[1]), Name.SCALE)
        assert found.verdict is FindingVerdict.WRONG
        assert found.value == pytest.approx(2.0, abs=0.5)
        assert ("counts +" in found.short) == (percent > 0.0)


def test_the_other_direction_of_a_wrong_scale_is_no_fault_of_a_sound_run(whole):
    first, second = spoilt(run(whole, "b ccw 1"), scaled, 2.0), run(whole, "b cw 1")
    assert finding_of(judged([first], second), Name.SCALE).verdict is FindingVerdict.GOOD


def test_a_recording_without_its_feed_in_says_nothing_of_the_scale(whole):
    one = replace(run(whole, "b ccw 1"), ways=None)
    assert finding_of(judged([], one), Name.SCALE).verdict is FindingVerdict.CANNOT_TELL


def white(sigma_um: float, step_um: float, seed: int) -> RawCircle:
    noise = np.random.default_rng(seed).normal(0.0, sigma_um, 2000)
    length = 150.0 + 1e-3 * step_um * np.round(noise / step_um)
    phi = np.linspace(0.0, 359.9, 2000)
    return RawCircle("", CIRCLE, phi / CIRCLE.turning_deg_s, phi, length)


def test_readings_that_come_twice_are_found_where_the_step_is_finer_than_the_noise():
    for seed in range(50):
        # A step of a quarter of sigma: one of ten is equal to the one before by chance.
        raw = white(0.4, 0.1, seed)
        assert repeated(raw).verdict is FindingVerdict.GOOD
        assert repeated(raw).value == pytest.approx(100.0 * 0.25 / np.sqrt(4.0 * np.pi), abs=3.0)
        for times in (2, 5):
            twice = replace(raw, length_mm=raw.length_mm[np.arange(2000) // times * times])
            found = repeated(twice)
            assert found.verdict is FindingVerdict.WRONG
            assert found.value > 100.0 * (1.0 - 1.0 / times)
    coarse = white(0.2, 1.0, 3)
    assert repeated(coarse).verdict is FindingVerdict.CANNOT_TELL


def test_one_reading_of_ten_that_comes_again_is_no_harm():
    """A clock of 50 Hz asks a gauge of 45 Hz: U is too small by a twentieth."""
    raw = white(0.4, 0.01, 1)
    kept = np.arange(2000) - (np.arange(2000) % 10 == 1)
    assert repeated(replace(raw, length_mm=raw.length_mm[kept])).verdict is FindingVerdict.GOOD


def test_readings_that_come_twice_are_found_on_a_run(whole):
    wrong = judged([], spoilt(run(whole, "b ccw 1"), coming_twice)).wrong
    assert Name.REPEATED in {one.name for one in wrong}


def test_a_form_that_other_tests_do_not_expect_is_found_in_both_directions(whole):
    sizes = {}
    for um in (0.0, 20.0):
        runs = [spoilt(one, oval, um) if one.run.test == "d" else one for one in whole.runs]
        found = SessionRuns(runs).judge(next(one for one in runs if one.run.label == "d cw 1"))
        sizes[um] = {one.name for one in found.wrong}
    assert sizes == {0.0: set(), 20.0: {Name.FORM}}
