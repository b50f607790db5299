"""Findings from a single run; other runs can only widen their limits."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import bdtrik

from dbbstation.circles.noise import LEAST_UM
from dbbstation.computing.arrays import average_of, hypot_of, median_of, sum_of
from dbbstation.quality.bump import bump
from dbbstation.quality.finding import DO, Finding, FindingVerdict, Name, found, undecided
from dbbstation.quality.held import ALL_EQUAL, SHORTEST_S, chance_equal, equal_readings, held, moving_noise
from dbbstation.quality.knowledge import Others, due_s
from dbbstation.quality.limits import FEWEST_OTHERS, SHARE, joined, quantile, scale_of
from dbbstation.quality.spike import spike
from dbbstation.trace.cut import FEED_SIGMAS, FEED_TOLERANCE, edges_of, feed_off
from dbbstation.trace.expected import form_columns
from dbbstation.trace.recording import share_lost

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats
    from dbbstation.quality.knowledge import Seen
    from dbbstation.trace.expected import Expected
    from dbbstation.trace.recording import RawCircle


HARMLESS = 0.19
"""Harmless share of repeated readings: with 0.81 n new readings of n, U of slow figures is too small by a tenth, 1 /
sqrt(0.81); U is stated to two digits."""


def repeated(raw: RawCircle) -> Finding:
    """Judge how many readings repeat the previous reading, except in long standstills."""
    first, last = equal_readings(raw)
    if len(first) == 1:
        return undecided(Name.REPEATED, ALL_EQUAL)
    short = raw.t_s[last] - raw.t_s[first] < SHORTEST_S
    squares_mm2, count, step_mm = moving_noise(raw)
    chance = chance_equal(squares_mm2, count, step_mm)
    share = sum_of((last - first)[short]) / max(count, 1)
    if chance >= 1.0:
        why = f"{100.0 * share:.0f} % of the readings are the same as the one before; their step is not finer than their noise"
        return undecided(Name.REPEATED, why, 100.0 * share)
    limit = max(HARMLESS, float(bdtrik(1.0 - SHARE, count, chance)) / count)
    stated = f"{100.0 * share:.0f} % of the readings are the same as the one before"
    again = f"{100.0 * share:.0f} % of the readings come more than once"
    return found(Name.REPEATED, 100.0 * share, 100.0 * limit, stated, short=again)


def lost_samples(one: Seen) -> Finding:
    """Judge the share of lost samples by the plan's limit."""
    lost, kept = one.lost
    percent = 100.0 * lost / max(lost + kept, 1)
    stated = share_lost(lost, kept, one.unusable) if lost else "no sample is missing on the turn"
    return found(Name.LOST, percent, one.run.largest_loss_percent, stated)


def noise(one: CircleAnalysis, others: Others) -> Finding:
    """Judge the noise by the noise of other runs."""
    value = max(one.noise.reading_um, LEAST_UM)
    if not one.noise.known:
        return undecided(Name.NOISE, "too few samples to separate noise from form")
    known = [max(other, LEAST_UM) for other in others.noise_um if np.isfinite(other)]
    if len(known) < FEWEST_OTHERS:
        return undecided(Name.NOISE, f"{value:.2f} µm; fewer than {FEWEST_OTHERS} other runs to hold it against", value)
    logs = np.log(known)
    middle = median_of(logs)
    own = 1.0 / sqrt(2.0 * one.noise.reading_freedom)
    # The median of n values has the standard error sqrt(pi / 2n) times their scatter.
    u = own * sqrt(1.0 + 0.5 * np.pi / len(known))
    log_limit = middle + _beyond(u, np.inf, [(float(log - middle), own) for log in logs])
    if log_limit > LARGEST_LOG:
        why = f"{value:.2f} µm; the noise of the other runs differs too much to hold it against"
        return undecided(Name.NOISE, why, value)
    stated = f"{value:.2f} µm per reading"
    wrong = f"{stated}, {np.exp(middle):.2f} µm in the other runs"
    return found(Name.NOISE, value, float(np.exp(log_limit)), stated, wrong)


LARGEST_LOG = float(np.log(1e4))
"""Logarithm of the greatest limit in micrometres, the travel of a gauge."""


def closure(one: CircleAnalysis, others: Others, expected: Expected | None = None) -> Finding:
    """Judge the difference between end and beginning of the turn by noise and other runs."""
    if one.closure is None or not one.noise.known:
        return undecided(Name.CLOSURE, "too few samples, at the ends of the turn or to separate noise from form")
    u = one.closure.u_um
    limit = max(_beyond(u, one.noise.freedom, others.closure_um), _left_open_um(expected))
    stated = f"the turn ends {one.closure.height_um:+.2f} µm off its beginning"
    return found(Name.CLOSURE, abs(one.closure.height_um), limit, stated)


def drift(one: CircleAnalysis, others: Others, expected: Expected | None = None) -> Finding:
    """Judge the difference between both passes of the overlap by noise, feed and other runs."""
    if one.passes is None:
        return undecided(Name.DRIFT, "the recording was cut to its turn: no place is passed twice")
    if not one.noise.known:
        return undecided(Name.DRIFT, "too few samples to separate noise from form")
    passes = one.passes
    u = passes.u_mean_um(one.noise.sigma_um)
    limit = _beyond(hypot_of(u, _by_feed_um(one)), one.noise.freedom, others.drift_um)
    limit = max(limit, _left_open_um(expected))
    stated = f"the bar reads {passes.mean_um:+.2f} µm more after one turn of {passes.turn_s:.0f} s"
    return found(Name.DRIFT, abs(passes.mean_um), limit, stated)


def _left_open_um(expected: Expected | None) -> float:
    """Return the drift that moves the centre by the ball's stated uncertainty [µm]."""
    # A linear drift D over the turn is a sawtooth with the first harmonic D / pi.
    return 0.0 if expected is None else np.pi * expected.place_um


def _by_feed_um(one: CircleAnalysis) -> float:
    if one.feed_mm_min is None:
        return 0.0
    shown, u = one.feed_mm_min
    share = hypot_of(shown - one.raw.circle.feed_mm_min, u) / one.raw.circle.feed_mm_min
    reach = np.radians(one.raw.circle.overshoot_deg)
    phi = np.radians(one.raw.phi_deg)
    ends = np.interp([reach, 2.0 * np.pi - reach], phi, one.raw.length_mm)
    slope_um = 1e3 * abs(float(ends[0] - ends[1])) / (2.0 * reach)
    return 2.0 * np.pi * share * slope_um


def _beyond(u: float, freedom: float, others: Sequence[tuple[float, float]]) -> float:
    parts = [(u, freedom)]
    if len(others) >= FEWEST_OTHERS:
        scale, known = scale_of([value / own for value, own in others])
        # A few runs may scatter by more than their noise by chance.
        if scale > 1.0 + CHANCE_SIGMAS / np.sqrt(2.0 * known):
            usual = median_of([own for _, own in others])
            parts.append((usual * sqrt(scale**2 - 1.0), known))
    total, together = joined(parts)
    return quantile(together) * total


CHANCE_SIGMAS = 1.645
"""Other runs widen a limit only if their scatter exceeds chance at the 5 % level. Otherwise a few runs with uncertain
scatter would make the limit useless."""


def feed(one: Seen, others: Others) -> Finding:
    """Judge the overlap's feed by the same limits as `cut`."""
    # If the overlap has too little shape, the duration decides. Stops at corners are assumed as long as in other runs,
    # or at most `LONGEST_STOP_S`.
    if one.feed_mm_min is None:
        return _feed_by_duration(one, others)
    shown, u = one.feed_mm_min
    programmed = one.run.circle.feed_mm_min
    limit = max(FEED_TOLERANCE * programmed, FEED_SIGMAS * u)
    stated = f"the overlap shows {shown:.1f} ± {u:.1f} mm/min, programmed are {programmed:g}"
    off = limit * feed_off(
        one.feed_mm_min, one.run.recording, one.run.circle, edges_of(one.run.recording, one.run.circle)
    )
    return found(Name.FEED, off, limit, stated, short=f"feed {shown:.0f} of {programmed:g} mm/min")


def _feed_by_duration(one: Seen, others: Others) -> Finding:
    circle, why = one.run.circle, "the overlap is too short or too round to show the feed"
    if one.longer_s is None:
        return undecided(Name.FEED, why)
    due = due_s(circle)
    usual, scatter = LONGEST_STOP_S, 0.0
    if len(others.longer_s) >= FEWEST_OTHERS:
        usual = median_of(others.longer_s)
        scatter, _ = scale_of([longer - usual for longer in others.longer_s])
    limit = max(FEED_TOLERANCE * due + UNEVEN_STOP_S, quantile(np.inf) * scatter)
    over = one.longer_s - usual
    if over <= limit:
        return undecided(Name.FEED, f"{why}; feed-in to feed-out took {due + one.longer_s:.1f} s, {due:.1f} s were due")
    programmed = circle.feed_mm_min
    shown = programmed * due / (due + over)
    stated = (
        f"feed-in to feed-out took {due + one.longer_s:.1f} s, {due + usual:.1f} s at the most at {programmed:g} mm/min"
    )
    short = f"feed {shown:.0f} of {programmed:g} mm/min on average"
    return found(Name.FEED, programmed - shown, programmed * limit / (due + limit), stated, short=short)


LONGEST_STOP_S = 4.0
"""Longest total stop at both corners if other runs do not show it [s]. The station's programs wait 0.3 s at each
corner; no known program waits two seconds."""

UNEVEN_STOP_S = 0.6
"""Possible variation of the total stop between runs [s]: none, or 0.3 s at each corner."""


def by_itself(one: Seen, others: Others) -> tuple[Finding, ...]:
    """Return all findings that need neither an expected place nor a counterpart."""
    if one.analysis is None:
        whole = Finding(Name.CIRCLE, None, None, "", FindingVerdict.WRONG, one.problem)
        shown = feed(one, Others())
        return (whole, lost_samples(one), *((shown,) if shown.wrong else ()))
    expected = one.run.expected
    if not one.alone:
        reversals = () if expected is None else expected.reversals_deg
        raw = one.analysis.raw
        one.alone.extend([bump(one.analysis, reversals), spike(one.analysis, reversals), held(raw), repeated(raw)])
    closed = closure(one.analysis, others, expected)
    slower = _slower(one, others) if closed.wrong else None
    return (
        lost_samples(one),
        noise(one.analysis, others),
        closed,
        drift(one.analysis, others, expected),
        *one.alone,
        slower or feed(one, others),
    )


def _slower(one: Seen, others: Others) -> Finding | None:
    circle, recording = one.run.circle, one.run.recording
    if one.feed_mm_min is not None or one.longer_s is None:
        return None
    due = due_s(circle)
    usual = median_of(others.longer_s) if len(others.longer_s) >= FEWEST_OTHERS else 0.0
    longer = (one.longer_s - usual) / due
    begun_s, ended_s = edges_of(recording, circle)
    turn_s = 360.0 / circle.turning_deg_s * np.array([1.0, 1.0 + longer])
    ends_s = 0.5 * (begun_s + ended_s) + 0.5 * np.outer(turn_s, [-1.0, 1.0])
    lengths = np.interp(ends_s, recording.good.t_s, recording.good.length_mm)
    as_planned, closed = np.abs(np.diff(lengths, axis=1))[:, 0]
    if longer < LEAST_SLOWER or closed > 0.5 * as_planned:
        return None
    shown = circle.feed_mm_min / (1.0 + longer)
    short = f"feed {shown:.0f} of {circle.feed_mm_min:g} mm/min"
    stated = f"feed-in to feed-out took {due + one.longer_s:.1f} s, {due + usual:.1f} s were due, and the turn closes at {short}"
    limit = circle.feed_mm_min * LEAST_SLOWER
    off = circle.feed_mm_min - shown
    return Finding(Name.FEED, off, limit, "mm/min", FindingVerdict.WRONG, f"{stated}: {DO[Name.FEED]}", short)


LEAST_SLOWER = 0.08
"""Least relative excess of the turn's time for this finding: overrides have steps of a tenth, and corner stops total a second."""


def scale(one: Seen, others: Others) -> Finding:
    """Judge the excess of measured over programmed feed-in and feed-out."""
    # Effects on the feed-in follow from effects on the circle. Over a distance w, a cause that depends on pose or time
    # changes by the share w / R. A cause that depends on the path acts fully, because it acts only in motion, at the
    # corner. Lag and play change sign with direction and cancel in the mean of both directions. The smaller of both
    # results counts.
    expected, feed_in_um = one.run.expected, 1e3 * one.run.circle.feed_in_mm
    if one.ways is None:
        return undecided(Name.SCALE, "feed-in and feed-out are not in the recording, or have too few samples")
    if expected is None:
        return undecided(Name.SCALE, "how far a sound machine misses the feed-in is not known")
    own_um = _excess_um(one)
    u_um = _u_um([(one, expected)])
    size, limit, counted = abs(own_um), quantile(np.inf) * u_um, own_um
    other = others.opposite
    if other is not None and other.ways is not None and other.run.expected is not None:
        both_um = 0.5 * (own_um + _excess_um(other))
        together = quantile(np.inf) * _u_um([(one, expected), (other, other.run.expected)])
        least = min(abs(both_um), abs(own_um))
        # Choose the result nearer its limit: the mean of both directions or this direction alone.
        if least * limit > size * together:
            size, limit, counted = least, together, both_um
    percent = 100.0 * counted / feed_in_um
    stated = f"feed-in and feed-out read {percent:+.2f} % more than their {one.run.circle.feed_in_mm:g} mm"
    short = f"the gauge counts {percent:+.1f} % too much"
    return found(Name.SCALE, 100.0 * size / feed_in_um, 100.0 * limit / feed_in_um, stated, short=short)


def _excess_um(one: Seen) -> float:
    assert one.ways is not None  # noqa: S101 - asked before
    return average_of([way.way_um for way in one.ways]) - 1e3 * one.run.circle.feed_in_mm


def _u_um(runs: list[tuple[Seen, Expected]]) -> float:
    noise, effects = 0.0, dict[tuple[str, str], "Floats"]()
    for one, expected in runs:
        assert one.ways is not None  # noqa: S101 - asked before
        noise += sum(way.u_um**2 for way in one.ways) / (len(one.ways) * len(runs)) ** 2
        circle = one.run.circle
        theta = np.radians(circle.direction.sign * np.array([way.phi_deg for way in one.ways]))
        at_corners = form_columns(theta).mean(axis=0) / len(runs)
        for key, effect in expected.effects_um.items():
            share = 1.0 if key in expected.moving else circle.feed_in_mm / circle.bar_mm
            mine = share * (at_corners @ effect)
            effects[key] = effects[key] + mine if key in effects and effects[key].shape == mine.shape else mine
    return sqrt(noise + sum(float(each @ each) for each in effects.values()))
