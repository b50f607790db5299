"""Figures of circles against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.circles.analysis import analyse, analyse_pair, refiltered
from dbbstation.circles.path import Filter
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.analysis import figures, passes_of
from dbbstation.trace.cut import FINEST_STEP_MM
from dbbstation.trace.recording import RawCircle, Recording

CCW = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
CW = replace(CCW, direction=Direction.CW)
PHI = np.arange(0.0, 360.0, 0.125)


def measured(form_um, circle=CCW, ball_mm=(0.0, 0.0), phi=PHI):
    """What a bar reads on a path that departs from the circle by a form of its angle, about a ball beside the centre."""
    theta = np.radians(circle.theta_deg(phi))
    radius = circle.radius_mm + 1e-3 * form_um(theta)
    across = radius * np.cos(theta) - ball_mm[0], radius * np.sin(theta) - ball_mm[1]
    height = circle.bar_mm * np.sin(np.radians(circle.elevation_deg))
    length = np.sqrt(across[0] ** 2 + across[1] ** 2 + height**2)
    return RawCircle("a run", circle, phi / circle.turning_deg_s, phi, length)


def flat(theta):
    return np.zeros_like(theta)


def test_a_perfect_circle_about_a_ball_beside_it():
    one = analyse(measured(flat, ball_mm=(-0.3, 0.4)))
    assert one.centre_mm == pytest.approx((0.3, -0.4), abs=1e-8)
    assert one.g_um == pytest.approx(0.0, abs=1e-5)
    assert one.g_least_squares_um == pytest.approx(0.0, abs=1e-5)
    assert one.radius_error_um == pytest.approx(0.0, abs=1e-5)
    # About the commanded centre the path is off by up to the distance of the ball.
    assert one.f_commanded.largest_um == pytest.approx(500.0, abs=0.1)
    assert one.f_commanded.least_um == pytest.approx(-500.0, abs=0.1)
    assert one.f_centred.largest_um == pytest.approx(0.0, abs=1e-5)


def test_a_larger_circle():
    one = analyse(measured(lambda theta: 7.0 + flat(theta)))
    assert (one.radius_error_um, one.f_centred.largest_um, one.f_centred.least_um) == pytest.approx((7.0, 7.0, 7.0))
    assert one.mean_radial_error_um == pytest.approx(7.0)


def test_an_ellipse():
    """Semi-axes R + 10 and R - 10 µm: both zones are 20 µm wide, and F is ± 10."""
    one = analyse(measured(lambda theta: 10.0 * np.cos(2 * theta)))
    assert one.g_um == pytest.approx(20.0, rel=1e-4)
    assert one.g_least_squares_um == pytest.approx(20.0, rel=1e-4)
    assert one.f_centred.largest_um == pytest.approx(10.0, rel=1e-3)
    assert one.f_centred.least_um == pytest.approx(-10.0, rel=1e-3)
    assert one.harmonics[0].undulations == 2
    assert one.harmonics[0].amplitude_um == pytest.approx(10.0, rel=1e-3)
    assert min(one.harmonics[0].peak_deg, 180.0 - one.harmonics[0].peak_deg) == pytest.approx(0.0, abs=0.01)
    assert max(h.amplitude_um for h in one.harmonics[1:]) < 0.01


@pytest.mark.parametrize(("lobes", "peak_deg"), [(3, 20.0), (5, 50.0), (7, 11.0)])
def test_lobes(lobes, peak_deg):
    one = analyse(measured(lambda theta: 4.0 * np.cos(lobes * (theta - np.radians(peak_deg)))))
    assert one.g_um == pytest.approx(8.0, rel=1e-3)
    lobe = next(h for h in one.harmonics if h.undulations == lobes)
    assert lobe.amplitude_um == pytest.approx(4.0, rel=1e-3)
    assert lobe.peak_deg == pytest.approx(peak_deg, abs=0.05)


def test_the_minimum_zone_is_not_wider_than_the_least_squares_one():
    rng = np.random.default_rng(5)
    for _ in range(20):
        a = rng.normal(0.0, 5.0, 8)
        one = analyse(measured(lambda theta, a=a: sum(a[k] * np.cos((k + 2) * theta + k) for k in range(8))))
        assert one.g_um <= one.g_least_squares_um + 1e-9


def test_least_squares_figures_are_those_of_the_other_commands():
    raw = measured(lambda theta: 10.0 * np.cos(2 * theta) + 3.0 * np.sin(5 * theta), ball_mm=(0.1, 0.2))
    one, other = analyse(raw), figures(raw)
    assert one.g_least_squares_um == other.circularity_um
    assert one.centre_mm == other.centre_mm
    assert one.mean_radial_error_um == other.mean_radial_error_um


@pytest.mark.parametrize("tilt_deg", [(0, 0, 0), (10, -10, 0)])
def test_a_raised_bar_measures_the_circle_in_its_plane(tilt_deg):
    circle = replace(CCW, elevation_deg=30, tilt_deg=tilt_deg)
    raw = measured(lambda theta: 5.0 + 10.0 * np.cos(2 * theta), circle, (-0.05, -0.02))
    one = analyse(raw)
    assert one.path.radius_mm == pytest.approx(150 * np.cos(np.radians(30)))
    assert one.g_um == pytest.approx(20.0, rel=1e-3)
    assert one.radius_error_um == pytest.approx(5.0, abs=1e-2)
    assert one.centre_mm == pytest.approx((0.05, 0.02), abs=1e-5)
    assert one.mean_radial_error_um == pytest.approx(5.0 * np.cos(np.radians(30)), abs=0.02)


@pytest.mark.parametrize("circle", [CCW, CW])
def test_steps_at_reversals_are_signed_along_the_travel(circle):
    """6 µm farther out behind +Y, 2 µm farther in behind -X, in the sense of travel."""
    raw = measured(flat, circle)
    phi_y, phi_x = (circle.phi_deg(np.array([at]))[0] for at in (90.0, 180.0))
    step = 6.0 * (phi_y < PHI) - 2.0 * (phi_x < PHI)
    one = analyse(replace(raw, length_mm=raw.length_mm + 1e-3 * step))
    heights = {step.theta_deg: step.height_um for step in one.steps}
    assert heights[90.0] == pytest.approx(6.0, abs=0.05)
    assert heights[180.0] == pytest.approx(-2.0, abs=0.05)
    assert heights[270.0] == pytest.approx(0.0, abs=0.05)
    assert 0.0 not in heights  # the turn begins there
    assert one.closure is not None
    assert one.closure.height_um == pytest.approx(4.0, abs=0.05)


def test_a_filter_takes_what_its_equation_says():
    raw = measured(lambda theta: 10.0 * np.cos(2 * theta) + 1.0 * np.cos(50 * theta), ball_mm=(0.2, 0.0))
    plain, filtered = analyse(raw), analyse(raw, chosen=Filter.UPR_50)
    assert plain.g_um > 21.0
    assert filtered.harmonics == plain.harmonics
    assert filtered.centre_mm == plain.centre_mm
    # Half of the short wave is left, and 0.9989 of the long one: crests of both lie together at 0 degrees.
    assert filtered.f_centred.largest_um == pytest.approx(0.5 + 10.0 * 2.0 ** -((2 / 50) ** 2), abs=0.02)
    assert analyse(raw, chosen=Filter.UPR_15).g_um == pytest.approx(20.0 * 2.0 ** -((2 / 15) ** 2), abs=0.02)


def test_both_directions():
    """Backlash that opens the path by 3 µm one way and closes it by 1 µm the other, on one mounting."""
    one = analyse(measured(lambda theta: 3.0 + 5.0 * np.cos(2 * theta), CCW, (0.1, 0.0)))
    other = analyse(measured(lambda theta: -1.0 + 5.0 * np.cos(2 * theta), CW, (0.1, 0.0)))
    pair = analyse_pair(one, other)
    assert pair.d_um == pytest.approx(1.0, abs=1e-3)
    assert pair.g_um == pytest.approx(14.0, abs=0.01)  # from -1 - 5 to 3 + 5
    assert pair.g_least_squares_um == pytest.approx(14.0, abs=0.01)
    assert pair.h_um == pytest.approx(4.0, abs=1e-2)
    assert analyse_pair(other, one).g_um == pytest.approx(pair.g_um, abs=1e-6)


def test_a_centre_that_changes_with_the_direction_is_not_taken_out():
    one = analyse(measured(flat, CCW, (0.004, 0.0)))
    other = analyse(measured(flat, CW, (-0.004, 0.0)))
    pair = analyse_pair(one, other)
    assert pair.g_um == pytest.approx(8.0, rel=0.01)
    assert pair.h_um == pytest.approx(8.0, rel=0.01)


def test_noise_is_read_where_the_form_is_not():
    rng = np.random.default_rng(6)
    raw = measured(lambda theta: 30.0 * np.cos(2 * theta) + 5.0 * np.cos(17 * theta))
    one = analyse(replace(raw, length_mm=raw.length_mm + rng.normal(0.0, 5e-4, len(PHI))))
    assert one.noise.slow_um == pytest.approx(0.5, rel=0.15)
    assert one.noise.reading_um == pytest.approx(0.5, rel=0.05)


def test_readings_that_come_in_steps():
    raw = measured(lambda theta: 30.0 * np.cos(2 * theta))
    one = analyse(replace(raw, length_mm=np.round(raw.length_mm, 3)))
    assert one.noise.resolution_um == pytest.approx(1.0)
    assert one.noise.sigma_um >= 1.0 / np.sqrt(12.0)


def test_two_readings_by_turns_show_their_step():
    """The coarsest gauge that shows a step: a form within one of its steps."""
    raw = measured(lambda theta: 12.0 * np.cos(2 * theta))
    one = analyse(replace(raw, length_mm=np.where(raw.length_mm > 150.0, 150.01, 150.0)))
    assert one.noise.resolution_um == pytest.approx(10.0)
    held = analyse(replace(raw, length_mm=np.where(PHI < -1.0, 150.01, 150.0)))
    assert held.noise.resolution_um == 0.0


def whole_run(form_um, circle=CCW, drift_um_per_turn=0.0):
    """A recording with feed-in, overshoot and feed-out at 100 Hz."""
    rate, out_s = 100.0, 1.0
    feed_s = circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    arc_s = circle.swept_deg / circle.turning_deg_s
    t = np.arange(0.0, 2 * out_s + 2 * feed_s + arc_s, 1.0 / rate)
    arc = np.clip(t - out_s - feed_s, 0.0, arc_s)
    phi = arc * circle.turning_deg_s - circle.overshoot_deg
    outside = circle.feed_in_mm * np.clip(1.0 - (t - out_s) / feed_s, 0.0, 1.0)
    outside += circle.feed_in_mm * np.clip((t - out_s - feed_s - arc_s) / feed_s, 0.0, 1.0)
    form = form_um(np.radians(circle.theta_deg(phi))) + drift_um_per_turn * phi / 360.0
    return Recording("a run", t, circle.bar_mm + outside + 1e-3 * form)


def test_both_passes_of_the_overlap_show_drift():
    passes = passes_of(whole_run(lambda theta: 40.0 * np.sin(2 * theta), drift_um_per_turn=2.5), CCW)
    assert passes.mean_um == pytest.approx(2.5, abs=0.02)
    assert passes.turn_s == pytest.approx(2 * np.pi * 150 / 1000 * 60)
    assert np.abs(passes.phi_deg).max() <= 40.0


def test_a_recording_with_angles_has_no_overlap():
    recording = whole_run(flat)
    assert passes_of(replace(recording, theta_deg=np.zeros(len(recording))), CCW) is None


def test_another_filter_changes_f_and_leaves_the_radius():
    """An ellipse of ± 10 µm on a circle 7 µm too large, with a ripple above the cut-off: without it F is 17 and -3 µm."""

    def form_um(theta):
        return 7.0 + 10.0 * np.cos(2 * theta) + 3.0 * np.cos(60 * theta)

    other = refiltered(analyse(measured(form_um)), Filter.UPR_30)
    assert (other.f_centred.largest_um, other.f_centred.least_um) == pytest.approx((17.0, -3.0), abs=0.05)
    assert (other.f_commanded.largest_um, other.f_commanded.least_um) == pytest.approx((17.0, -3.0), abs=0.05)
    assert other.radius_error_um == pytest.approx(7.0, abs=0.01)


def test_without_a_filter_a_path_passes_as_it_is():
    theta_deg = np.linspace(0.0, 360.0, 500, endpoint=False)
    values = 5.0 * np.cos(np.radians(40 * theta_deg))
    np.testing.assert_array_equal(Filter.of_word("none").through(theta_deg, values), values)
    assert np.abs(Filter.UPR_30.through(theta_deg, values)).max() < 1e-9


def test_the_least_noise_is_that_of_computed_readings_rounded_to_the_smallest_shape():
    """Lengths that are rounded to 0.1 µm scatter by it: brute force over 100 000 of them."""
    length_mm = np.random.default_rng(9).uniform(150.0, 150.1, 100_000)
    off_um = 1e3 * (length_mm - FINEST_STEP_MM * np.round(length_mm / FINEST_STEP_MM))
    assert analyse(measured(flat)).noise.least_um == pytest.approx(np.std(off_um), rel=0.01)
