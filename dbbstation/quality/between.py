"""Findings about a run beside others of its test: wrong direction, against the other direction, against the repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.finding import Finding, Name, Verdict, found, undecided
from dbbstation.quality.knowledge import HIGHEST_HARMONIC, Others, Seen, across, apart_um
from dbbstation.quality.limits import FEWEST_OTHERS, length_limit, length_quantile, quantile, ratio_quantile

if TYPE_CHECKING:
    from collections.abc import Sequence


SCATTERING = 3
"""Dimensions in which runs of one circle scatter at the least: where the ball came to lie in X and Y, and how long the bar is.
The other four numbers scatter less; were they counted in full, a limit would be taken for better known than it is."""


def direction(one: Seen, others: Others) -> Finding:
    """Whether the circle was run in the direction that its name says.

    A bar does not see which way the machine turns: feed-in and feed-out look alike, and either overlap passes its places twice.
    A circle that was run the wrong way shows its form mirrored about the axis through the start of the turn. So it can be seen
    where the circle lies off that axis and something says on which side: the expected centre, the other direction or a
    repeat. Lag and friction of drives change sign with the direction too, and would look like a mirror image; but they come
    back after half a turn, where both the speed and the direction of the bar are reversed: they have even undulations only
    [linear in the speed, or in its sign]. Odd ones, the centre above all, are compared.
    """
    by_place = _by_place(one)
    if by_place is not None:
        return by_place
    against = others.opposite or others.earlier
    if against is None:
        why = "no other run of this test, and the expected centre does not lie off the axis through the start"
        return undecided(Name.DIRECTION, f"cannot be seen: {why}", "µm")
    mine, theirs = across(one), across(against)
    apart, mirrored = float(np.linalg.norm(mine - theirs)), float(np.linalg.norm(mine + theirs))
    stated = f"off the axis through the start it is {apart:.1f} µm from run {against.run.label}, {mirrored:.1f} µm from its mirror image"
    if len(others.across_um) < FEWEST_OTHERS:
        # What both may differ by is not known: it is taken from the smaller of the two, with Fisher's limit.
        limit = mirrored * float(np.sqrt(ratio_quantile(len(mine), len(mine))))
        least = apart * float(np.sqrt(ratio_quantile(len(mine), len(mine))))
    else:
        by_noise = length_quantile(len(mine)) * float(np.hypot(one.u_um, against.u_um))
        limit = least = max(by_noise, length_limit(others.across_um, len(mine)))
    if apart > limit >= mirrored:
        why = f"{stated}: one of both was run the wrong way round; run both again"
        return Finding(Name.DIRECTION, apart, limit, "µm", Verdict.WRONG, why)
    if mirrored > least >= apart:
        return Finding(Name.DIRECTION, apart, limit, "µm", Verdict.GOOD, stated)
    why = (
        "too alike to tell" if max(apart, mirrored) <= max(limit, least) else "neither of them; something else differs"
    )
    return Finding(Name.DIRECTION, apart, limit, "µm", Verdict.CANNOT_TELL, f"{stated}: {why}")


def _by_place(one: Seen) -> Finding | None:
    """Judge by the expected centre; None where it cannot decide."""
    expected = one.run.expected
    if expected is None or not expected.place_known or one.analysis is None:
        return None
    start = np.radians(one.run.circle.start_deg)
    across = np.array([-np.sin(start), np.cos(start)])
    should = 1e3 * float(across @ expected.centre_mm)
    u = 1e3 * float(np.sqrt(across @ expected.covariance_mm2[:2, :2] @ across))
    is_um = 1e3 * float(across @ np.array(one.analysis.centre_mm))
    limit = quantile(np.inf) * u
    if abs(is_um + should) <= limit and abs(is_um - should) <= limit:
        return None
    stated = f"off the axis through the start the centre is at {is_um:+.1f} µm, expected at {should:+.1f} µm"
    if abs(is_um - should) > limit >= abs(is_um + should):
        why = f"{stated}: the circle was run the wrong way round; run it again"
        return Finding(Name.DIRECTION, abs(is_um - should), limit, "µm", Verdict.WRONG, why)
    if abs(is_um - should) > limit:
        return None  # neither way round: another finding's business
    return Finding(Name.DIRECTION, abs(is_um - should), limit, "µm", Verdict.GOOD, stated)


def other_direction(one: Seen, others: Others) -> Finding:
    """Form and place against the other direction on the same mounting."""
    if others.opposite is None:
        return undecided(Name.OTHER_DIRECTION, "the other direction was not measured on this mounting", "µm")
    value, u = apart_um(one, others.opposite)
    return _beside(Name.OTHER_DIRECTION, others.opposite, value, u, others.directions_um, "the machine's own reversal")


def repeat(one: Seen, others: Others) -> Finding:
    """Form and place against the repeat before."""
    if others.earlier is None:
        return undecided(Name.REPEAT, "there is no earlier run of this test and direction", "µm")
    value, u = apart_um(one, others.earlier)
    expected = one.run.expected
    if one.run.mounting != others.earlier.run.mounting and expected is not None:
        # A shift d moves two coefficients, by d / sqrt 2 each; both mountings scatter.
        u = float(np.hypot(u, 1e3 * expected.mounting_mm))
    return _beside(Name.REPEAT, others.earlier, value, u, others.repeats_um, "what changed in between")


def _beside(
    name: Name, other: Seen, value: float, u: float, usual: Sequence[tuple[float, float]], else_: str
) -> Finding:
    by_noise = length_quantile(2 * HIGHEST_HARMONIC + 1) * u
    stated = f"{value:.1f} µm rms from run {other.run.label} in mean, centre, ellipse and triangle"
    if len(usual) < FEWEST_OTHERS:
        if value <= by_noise:
            return found(name, value, by_noise, "µm", stated, stated)
        why = f"{stated}, {by_noise:.1f} µm by noise: a fault of one of both or {else_}; fewer than {FEWEST_OTHERS} other pairs"
        return undecided(name, why, "µm", value)
    lengths = [apart for apart, _ in usual]
    limit = max(by_noise, length_limit(lengths, SCATTERING))
    wrong = f"{stated}, {np.median(lengths):.1f} µm usual in this session: something moved between both; run both again"
    return found(name, value, limit, "µm", stated, wrong)
