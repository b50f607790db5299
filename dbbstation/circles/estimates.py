"""Figures of circles that have an uncertainty; G, F, H and G(b) without the contribution of noise."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.extremes import (
    DrawnPath,
    Estimate,
    drawn_paths,
    estimated,
    farthest_of,
    greatest_of,
    least_of,
    range_of,
)
from dbbstation.circles.form import form_and_noise
from dbbstation.circles.path import path_of
from dbbstation.circles.strip import strip_widths
from dbbstation.computing.arrays import hypot_of
from dbbstation.computing.kept import once_for_each
from dbbstation.facts.quantities import FULL_TURN_DEG

if TYPE_CHECKING:
    from dbbstation.circles.analysis import CircleAnalysis, PairAnalysis
    from dbbstation.circles.form import FormAndNoise
    from dbbstation.circles.path import Filter
    from dbbstation.computing.arrays import Floats


CLEAR = 2.0
"""Standard uncertainties above which a drift over the turn counts as form, not noise."""


def estimate_of(one: CircleAnalysis, quantity: BudgetQuantity) -> Estimate | None:
    """Return the estimate of G, G(LS), Fmax or Fmin; None for too few samples."""
    return _estimate(one, quantity) if one.noise.known else None


@once_for_each
def _estimate(one: CircleAnalysis, quantity: BudgetQuantity) -> Estimate:
    _, drawn, _ = _drawn(one)
    radius_um, deviation_um = one.radius_error_um, 1e3 * one.path.least_squares.deviation_mm
    match quantity:
        case BudgetQuantity.G:
            return estimated([drawn], strip_widths, one.g_um)
        case BudgetQuantity.G_LS:
            return estimated([drawn], range_of, one.g_least_squares_um)
        case BudgetQuantity.F_MAX:
            found = estimated([drawn], greatest_of, float(deviation_um.max()))
            return Estimate(radius_um + found.value_um, found.u_um, radius_um + found.as_read_um)
        case BudgetQuantity.F_MIN:
            found = estimated([drawn], least_of, float(-deviation_um.min()))
            return Estimate(radius_um - found.value_um, found.u_um, radius_um - found.as_read_um)
        case _:
            raise ValueError(f"{quantity} is not a range of one circle")


def slow_noise_um(one: CircleAnalysis, undulations: int) -> float:
    """Return the white noise per sample with the actual noise's effect on a figure [µm].

    Args:
        one: circle; with too few samples only its rounding counts.
        undulations: 0 for radius and mean, 1 for a centre.
    """
    if not one.noise.known:
        return one.noise.sigma_um
    return hypot_of(np.sqrt(_apart(one).continued.mean[undulations]), one.noise.least_um)


@once_for_each
def _apart(one: CircleAnalysis) -> FormAndNoise:
    if one.closure is None or abs(one.closure.height_um) <= CLEAR * one.closure.u_um:
        return form_and_noise(one.residual_um)
    ramp_um = one.closure.height_um * one.raw.phi_deg / FULL_TURN_DEG
    apart = form_and_noise(one.residual_um - ramp_um)
    return replace(apart, form_um=apart.form_um + ramp_um)


OF_A_CIRCLE = 2
"""Lines of the spectrum that the least-squares circle removes: radius and centre."""


@once_for_each
def _drawn(one: CircleAnalysis) -> tuple[Floats, DrawnPath, DrawnPath]:
    """Return form at samples, shape (n,) [µm], with noise drawn about its own and about the common least-squares circle."""
    apart, passed = _filtered(_apart(one), one.chosen)
    seed = int(one.raw.circle.direction.sign > 0)
    alone, beside = drawn_paths(apart, one.path.theta_deg, passed, seed, (OF_A_CIRCLE, 0))
    return apart.form_um, alone, beside


def pair_estimate(pair: PairAnalysis, quantity: BudgetQuantity) -> Estimate | None:
    """Return the estimate of G(b), G(b)(LS) or H; None for too few samples."""
    return _pair_estimate(pair, quantity) if pair.one.noise.known and pair.other.noise.known else None


@once_for_each
def _pair_estimate(pair: PairAnalysis, quantity: BudgetQuantity) -> Estimate:
    if quantity is BudgetQuantity.H:
        return _hysteresis(pair)
    paths = []
    split = np.split(1e3 * pair.together.least_squares.deviation_mm, [len(pair.one.raw)])
    for one, deviation_um in zip((pair.one, pair.other), split, strict=True):
        form_um, _, beside = _drawn(one)
        # About the common circle, each direction's radius and centre are form.
        beside_um = deviation_um - 1e3 * one.path.least_squares.deviation_mm
        paths.append(beside.with_form(form_um + beside_um))
    if quantity is BudgetQuantity.G_BOTH:
        return estimated(paths, strip_widths, pair.g_um)
    return estimated(paths, range_of, pair.g_least_squares_um)


def _filtered(apart: FormAndNoise, chosen: Filter) -> tuple[FormAndNoise, Floats]:
    count = len(apart.form_um)
    passed = chosen.passed(np.arange(count // 2 + 1.0))
    if not chosen:
        return apart, passed
    return replace(apart, form_um=np.fft.irfft(passed * np.fft.rfft(apart.form_um), count)), passed


def _hysteresis(pair: PairAnalysis) -> Estimate:
    paths = [path_of(one.raw) for one in (pair.one, pair.other)]
    theta_deg = np.sort(paths[0].theta_deg)
    radii = [np.interp(theta_deg, p.theta_deg, p.about_ball_mm, period=FULL_TURN_DEG) for p in paths]
    apart, passed = _filtered(form_and_noise(1e3 * (radii[0] - radii[1])), pair.one.chosen)
    return estimated(drawn_paths(apart, theta_deg, passed, 2), farthest_of, pair.h_um)


class BudgetQuantity(StrEnum):
    """Figures with a budget."""

    G = "G"
    G_LS = "G(LS)"
    F_MAX = "Fmax"
    F_MIN = "Fmin"
    RADIUS = "radius"
    MEAN_RADIAL = "mean radial error"
    X = "X"
    Y = "Y"
    G_BOTH = "G(b)"
    G_BOTH_LS = "G(b)(LS)"
    D = "D"
    H = "H"


ABSOLUTE = frozenset(
    {BudgetQuantity.F_MAX, BudgetQuantity.F_MIN, BudgetQuantity.RADIUS, BudgetQuantity.MEAN_RADIAL, BudgetQuantity.D}
)
"""Figures that depend on the bar's absolute length."""

FIRST = 2
"""First undulation of form: one per revolution is the centre."""
