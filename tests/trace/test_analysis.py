"""Circle figures against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import TraceError
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.analysis import _circles_about_ball, best_circle, centred, figures, figures_of
from dbbstation.trace.recording import RawCircle

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
THETA = np.arange(0, 360, 0.25)


def raw(length_mm, circle=CIRCLE):
    return RawCircle("a run", circle, np.arange(len(THETA)) * 0.01, THETA, length_mm)


def shifted_circle(radius, x, y):
    """Distance from the origin to a circle about (x, y), in every direction."""
    theta = np.radians(THETA)
    along = x * np.cos(theta) + y * np.sin(theta)
    return along + np.sqrt(radius**2 - (x * np.sin(theta) - y * np.cos(theta)) ** 2)


def ball_beside(radius, x, y):
    """What a bar reads on a perfect circle at commanded angles, its ball standing (-x, -y) beside the commanded centre."""
    theta = np.radians(THETA)
    return np.hypot(radius * np.cos(theta) + x, radius * np.sin(theta) + y)


def test_a_shifted_circle_is_found_exactly():
    centre, radius, deviation = best_circle(THETA, shifted_circle(150.1, 0.3, -0.4))
    assert centre == pytest.approx([0.3, -0.4], abs=1e-10)
    assert radius == pytest.approx(150.1, abs=1e-10)
    assert np.abs(deviation).max() < 1e-10


def test_figures_of_a_shifted_circle():
    found = figures(raw(ball_beside(150.1, 0.3, -0.4)))
    assert found.centre_deviation_um == pytest.approx(500)
    # The mean of the distance is R plus d²/4R to second order.
    assert found.mean_radial_error_um == pytest.approx(100 + 1e3 * 0.25 / 4 / 150, abs=1e-3)
    assert found.circularity_um == pytest.approx(0, abs=1e-6)


def test_a_ball_far_beside_the_centre_does_not_bend_a_perfect_circle():
    """At commanded angles a circle about a ball that stands 2 mm off has 27 µm of cos 2θ; seen from the ball it has none."""
    length_mm = ball_beside(150.0, 1.2, -1.6)
    bent = np.ptp(best_circle(THETA, length_mm)[2])
    assert 1e3 * bent == pytest.approx(1e3 * 2.0**2 / 150.0, rel=0.01)
    assert figures(raw(length_mm)).circularity_um == pytest.approx(0, abs=1e-4)


def test_figures_as_measured_are_worked_out_once(monkeypatch):
    worked_out = []

    def counted(theta_deg, radius_mm):
        worked_out.append(radius_mm)
        return _circles_about_ball(theta_deg, radius_mm)

    monkeypatch.setattr("dbbstation.trace.analysis._circles_about_ball", counted)
    one, other = raw(ball_beside(150.1, 0.3, -0.4)), raw(ball_beside(150.1, 0.1, 0.0))
    first = figures(one)
    assert figures(one) == first
    assert len(worked_out) == 1
    # Neither another circle, nor other lengths at its angles, are taken for it.
    assert figures(other).centre_deviation_um == pytest.approx(100)
    assert figures(one, other.length_mm) == figures(other)
    assert figures(one) == first
    assert len(worked_out) == 3


def test_circularity_of_an_ellipse():
    """A cos 2θ of amplitude A has the circularity 2A and no centre."""
    found = figures(raw(150 + 0.01 * np.cos(2 * np.radians(THETA))))
    assert found.circularity_um == pytest.approx(20, rel=1e-3)
    assert found.centre_deviation_um == pytest.approx(0, abs=1e-9)


def test_a_raised_bar_sees_the_horizontal_shift():
    circle = replace(CIRCLE, elevation_deg=30)
    height = 150 * np.sin(np.radians(30))
    horizontal = ball_beside(circle.radius_mm, 0.05, 0.02)
    found = figures(raw(np.hypot(horizontal, height), circle))
    assert found.centre_mm == pytest.approx((0.05, 0.02), abs=1e-9)


def test_centring_removes_the_centre_and_keeps_the_shape():
    shape = 0.01 * np.cos(3 * np.radians(THETA))
    result = centred(raw(150 + shape + 0.2 * np.cos(np.radians(THETA))))
    assert result.deviation_mm == pytest.approx(shape, abs=2e-4)
    assert not hasattr(result, "length_mm")


def test_a_point_is_no_circle():
    with pytest.raises(TraceError, match="do not determine a circle"):
        best_circle(np.array([10.0, 10.0, 10.0]), np.array([150.0, 150.0, 150.0]))


def test_figures_of_several_lengths_are_those_of_each_alone():
    """Among them a circle of which the ball is far off, and an arc too short for normal equations."""
    rng = np.random.default_rng(2)
    lengths_mm = np.array(
        [ball_beside(150.1, x, y) + 1e-3 * rng.standard_normal(len(THETA)) for x, y in rng.normal(size=(5, 2))]
    )
    for one, found in zip(lengths_mm, figures_of(raw(lengths_mm[0]), lengths_mm), strict=True):
        alone = figures(raw(one))
        assert found.centre_mm == pytest.approx(alone.centre_mm, abs=1e-9)
        assert found.circularity_um == pytest.approx(alone.circularity_um, abs=1e-6)
        assert found.mean_radial_error_um == pytest.approx(alone.mean_radial_error_um)
    few_deg = np.linspace(0.0, 10.0, 50)
    arcs = [150.0 - 0.01 * np.cos(np.radians(few_deg)), 150.0 + 0.02 * np.sin(np.radians(few_deg))]
    centres, radii, _ = best_circle(few_deg, np.array(arcs))
    for one, centre, radius in zip(arcs, centres, radii, strict=True):
        alone = best_circle(few_deg, one)
        assert centre == pytest.approx(alone[0], abs=1e-6)
        assert radius == pytest.approx(alone[1], abs=1e-6)
