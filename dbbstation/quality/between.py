"""Compare a run with other runs of its test: direction, opposite direction, repeat."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of, median_of, norm_of
from dbbstation.quality.finding import Finding, FindingVerdict, Name, found, undecided
from dbbstation.quality.knowledge import ACROSS, COEFFICIENTS, Others, Seen, across
from dbbstation.quality.limits import FEWEST_OTHERS, SCATTERING, length_limit, length_quantile, median_length, quantile
from dbbstation.quality.stated import covariance_apart, drifted_um, limit_along, limit_of_length, unseen_um2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.quality.knowledge import Expected


def direction(one: Seen, others: Others, expected: Expected | None = None) -> Finding:
    """Judge whether the circle ran in its named direction."""
    # A bar does not measure the direction. A reversed circle has its form mirrored about the axis through the start.
    # The mirrored form is visible if the circle is off this axis and the expected centre, the other direction or a
    # repeat gives the side. Lag and friction change sign with direction too, but repeat after half a turn: linear in
    # speed or its sign, they have only even undulations. Only odd undulations are compared.
    by_place = _by_place(one, expected)
    if by_place is not None:
        return by_place
    against = others.opposite or others.earlier
    if against is None:
        why = "no other run of this test, and the expected centre does not lie off the axis through the start"
        return undecided(Name.DIRECTION, f"cannot be seen: {why}")
    off, mirrored = across(one) - across(against), across(one) + across(against)
    apart, mirror = norm_of(off), norm_of(mirrored)
    stated = f"off the axis through the start it is {apart:.1f} µm from run {against.run.label}, {mirror:.1f} µm from its mirror image"
    limits = _across_limits(one, against, others, off, mirrored)
    if limits is None:
        return undecided(Name.DIRECTION, f"{stated}: what both may differ by is not known", apart)
    limit, of_mirror = limits
    if apart > limit and mirror <= of_mirror:
        why = f"{stated}: one of both was run the wrong way round; run both again"
        return Finding(Name.DIRECTION, apart, limit, "µm", FindingVerdict.WRONG, why)
    if apart <= limit and mirror > of_mirror:
        return Finding(Name.DIRECTION, apart, limit, "µm", FindingVerdict.GOOD, stated)
    why = "too alike to tell" if apart <= limit else "neither of them; something else differs"
    return Finding(Name.DIRECTION, apart, limit, "µm", FindingVerdict.CANNOT_TELL, f"{stated}: {why}")


def _across_limits(
    one: Seen, against: Seen, others: Others, off: Floats, mirrored: Floats
) -> tuple[float, float] | None:
    covariance = covariance_apart(one, against)
    rows = np.ix_(ACROSS, ACROSS)
    stated = None if covariance is None else [limit_along(covariance[rows], each) for each in (off, mirrored)]
    if len(others.across_um) < FEWEST_OTHERS:
        return None if stated is None else (stated[0], stated[1])
    by_noise = length_quantile(len(off)) * sqrt(unseen_um2(one, against))
    limit = max(by_noise, length_limit(others.across_um, len(off)))
    if stated is None or covariance is None:
        return limit, limit
    most = limit_of_length(covariance[rows])
    return min(limit, most), min(limit, most)


def _by_place(one: Seen, expected: Expected | None) -> Finding | None:
    if expected is None or not expected.place_known or one.analysis is None:
        return None
    start = np.radians(one.run.circle.start_deg)
    across = np.array([-np.sin(start), np.cos(start)])
    should = 1e3 * float(across @ expected.centre_mm)
    u = 1e3 * sqrt(across @ expected.covariance_mm2[:2, :2] @ across)
    is_um = 1e3 * float(across @ np.array(one.analysis.centre_mm))
    limit = quantile(np.inf) * u
    if abs(is_um + should) <= limit and abs(is_um - should) <= limit:
        return None
    stated = f"off the axis through the start the centre is at {is_um:+.1f} µm, expected at {should:+.1f} µm"
    if abs(is_um - should) > limit >= abs(is_um + should):
        why = f"{stated}: the circle was run the wrong way round; run it again"
        return Finding(Name.DIRECTION, abs(is_um - should), limit, "µm", FindingVerdict.WRONG, why)
    if abs(is_um - should) > limit:
        return None  # neither direction fits: other findings apply
    return Finding(Name.DIRECTION, abs(is_um - should), limit, "µm", FindingVerdict.GOOD, stated)


def other_direction(one: Seen, others: Others) -> Finding:
    """Judge the difference in form and place from the other direction."""
    if others.opposite is None:
        return undecided(Name.OTHER_DIRECTION, "the other direction has not been measured")
    return _beside(Name.OTHER_DIRECTION, one, others.opposite, others.directions_um, others.directions_stated)


def repeat(one: Seen, others: Others) -> Finding:
    """Judge the difference in form and place from the previous repeat."""
    if others.earlier is None:
        return undecided(Name.REPEAT, "there is no earlier run of this test and direction")
    return _beside(Name.REPEAT, one, others.earlier, others.repeats_um, others.repeats_stated)


def _beside(
    name: Name, one: Seen, other: Seen, usual: Sequence[tuple[float, float]], sigmas: Sequence[float]
) -> Finding:
    """Compare a run with another run of its test."""
    # With few other pairs, plan, machine file and usual causes give the limit. With enough pairs, their scatter gives
    # it, and raises it if it exceeds stated uncertainties. The limit is at least the limit by noise and plan, and at
    # most the largest stated allowance.
    off = one.coefficients_um - other.coefficients_um
    value = norm_of(off)
    stated = f"{value:.1f} µm rms from run {other.run.label} in mean, centre, ellipse and triangle"
    covariance = covariance_apart(one, other)
    if len(usual) < FEWEST_OTHERS:
        if covariance is None:
            why = f"{stated}; fewer than {FEWEST_OTHERS} other pairs, and nothing stated, to hold it against"
            return undecided(name, why, value)
        limit = limit_along(covariance, off)
        wrong = f"{stated}, at most {limit:.1f} µm by what machine and plan state: something moved between both; run both again"
        return found(name, value, limit, stated, wrong)
    lengths = [apart for apart, _ in usual]
    limit = max(length_quantile(COEFFICIENTS) * sqrt(unseen_um2(one, other)), length_limit(lengths, SCATTERING))
    limit = hypot_of(limit, quantile(np.inf) * drifted_um(one, other))
    if one.run.mounting != other.run.mounting and one.run.expected is not None:
        # A shift d changes two coefficients by d / sqrt 2 each, and both mountings scatter.
        limit = hypot_of(limit, length_quantile(2) * 1e3 * one.run.expected.mounting_mm)
    if covariance is not None:
        more = max(median_of(sigmas) / median_length(COEFFICIENTS), 1.0) if sigmas else 1.0
        limit = min(limit, more * limit_along(covariance, off), limit_of_length(covariance))
    wrong = f"{stated}, {np.median(lengths):.1f} µm usual in this session: something moved between both; run both again"
    return found(name, value, limit, stated, wrong)
