"""Compare a run with other runs of its test: direction, opposite direction, repeat, local differences."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of, median_of, norm_of, place_of_largest
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.knowledge import ACROSS, Others, Seen, across
from dbbstation.quality.limits import FEWEST_OTHERS, SCATTERING, length_limit, length_quantile, median_length, quantile
from dbbstation.quality.stated import apart_by, covariance_apart, drifted_um, limit_along, limit_of_length, unseen_um2
from dbbstation.trace.expected import COEFFICIENTS, LOCAL_COEFFICIENTS, LOCAL_HARMONIC, local_columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.trace.expected import Expected


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
    if (apart > limit) is (mirror <= of_mirror):
        return found(Name.DIRECTION, apart, limit, stated)
    why = "too alike to tell" if apart <= limit else "neither of them; something else differs"
    return undecided(Name.DIRECTION, f"{stated}: {why}", apart, limit)


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
    off_um = abs(is_um - should)
    if (off_um <= limit) is (abs(is_um + should) <= limit):
        return None  # both directions fit, or neither: other findings apply
    stated = f"off the axis through the start the centre is at {is_um:+.1f} µm, expected at {should:+.1f} µm"
    return found(Name.DIRECTION, off_um, limit, stated)


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
        wrong = f"{stated}, at most {limit:.1f} µm by what machine and plan state"
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
    wrong = f"{stated}, {np.median(lengths):.1f} µm usual in this session"
    return found(name, value, limit, stated, wrong)


LOWEST = 3
"""Lowest undulations per revolution in which local differences are compared. The second contains a shift's second order and most differences by
reversals; lower ones contain place and length."""

OTHER_REVERSALS = 0.25
"""Allowed ratio of odd to even undulations without a known cause: unmodelled play and friction repeat after nearly half
a turn. Known causes give 0.22 on the fifteen circles of `table2` with 10 to 30 µm of play in all struts. A bump of 10
µm and 60 degrees' width gives four times as much."""

ORDERS = np.concatenate([[0], np.arange(1, LOCAL_HARMONIC + 1), np.arange(1, LOCAL_HARMONIC + 1)])
"""Undulations per revolution of each coefficient of `local_columns`."""


def local_difference(one: Seen, others: Others) -> Finding:
    """Judge local differences in 3 to 29 undulations: dirt, contact, a push.

    In a single run the form hides a wide bump, but two runs share the form. All undulations of repeats are compared.
    With the other direction only odd undulations are compared, because lag, play and friction nearly repeat after half
    a turn.
    """
    # The limit is the sum of three parts: the ellipsoid of noise and known causes along the difference, a share of the
    # reversals' even undulations, and drift. A drift D over a turn is a sawtooth whose k-th undulation is D / (pi k).
    # Enough other pairs with larger differences widen the limit.
    against = others.opposite or others.earlier
    if against is None or one.analysis is None or against.analysis is None:
        return undecided(Name.LOCAL, "no other run of this test has been measured")
    if not (
        one.local_um.any() and against.local_um.any() and one.analysis.noise.known and against.analysis.noise.known
    ):
        return undecided(Name.LOCAL, "too few samples for undulations that are short")
    differs, counts = one.local_um - against.local_um, _compared(one, against)
    alike = one.run.circle.direction is against.run.circle.direction
    value = locally_apart_um(one, against)
    by_reversals = 0.0 if alike else OTHER_REVERSALS * norm_of(differs[(ORDERS > LOWEST) & ~counts])
    sawtooth = norm_of(1.0 / ORDERS[counts]) / (2.0 * np.pi)
    drifts = [
        abs(each.analysis.closure.height_um) for each in (one, against) if each.analysis and each.analysis.closure
    ]
    covariance = (one.u_um**2 + against.u_um**2) * np.eye(LOCAL_COEFFICIENTS)
    if one.run.expected is not None and against.run.expected is not None:
        covariance += apart_by(one.run.expected.local_um, against.run.expected.local_um, LOCAL_COEFFICIENTS)
    limit = sawtooth * sum(drifts) + by_reversals + limit_along(covariance[np.ix_(counts, counts)], differs[counts])
    if not alike and len(others.local_um) >= FEWEST_OTHERS:
        limit = max(limit, length_limit(others.local_um, SCATTERING))
    at_deg, height_um = _peak(np.where(ORDERS >= LOWEST, differs, 0.0))
    place = f"{height_um:+.1f} µm from run {against.run.label} at {at_deg:.0f} degrees"
    return found(
        Name.LOCAL,
        value,
        limit,
        f"nowhere does the path leave that of run {against.run.label}: at most {place}",
        f"the path is {place}",
        f"the path is {place}",
    )


def locally_apart_um(one: Seen, against: Seen) -> float:
    """Return the rms difference in the compared undulations [µm]."""
    return norm_of((one.local_um - against.local_um)[_compared(one, against)])


def _compared(one: Seen, against: Seen) -> Flags:
    alike = one.run.circle.direction is against.run.circle.direction
    return (ORDERS >= LOWEST) & (alike | (ORDERS % 2 == 1))


def _peak(differs_um: Floats) -> tuple[float, float]:
    theta_deg = np.arange(0.0, 360.0, 1.0)
    path = local_columns(np.radians(theta_deg)) @ differs_um
    top = place_of_largest(np.abs(path))
    return float(theta_deg[top]), float(path[top])
