"""Cut the full turn out of a recording with feed-in, overshoot and feed-out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.kept import once_for_each
from dbbstation.errors import TraceError
from dbbstation.facts.quantities import FULL_TURN_DEG, USUAL_STROKE_MM
from dbbstation.trace.columns import each
from dbbstation.trace.recording import AFTER_LOSS, RawCircle, lost_samples, means, share_lost

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.recording import Recording


LARGEST_GAP_DEG = 10.0
"""Widest gap without samples in a full circle."""

WRITTEN_DEG = 1e-5
"""Smaller differences of angles are rounding: run files have six decimals [deg]."""

SHORTEST_TURN = 0.3
"""A trace shorter than a turn by more than this share contains no turn at any plausible feed."""

FEED_SEARCH = 0.2
"""Largest shift between both passes of the overlap, as a share of the overshoot arc."""

FEED_TOLERANCE = 4e-3
"""Largest relative feed error; one per thousand costs 0.3 µm at 100 µm of error per radian. Feed mistakes are percents.
Friction, warming and chillers scatter real overlaps by thousandths."""

NEGLIGIBLE_DEG = 0.008
"""Negligible uncertainty of an angle: it costs less than 0.02 µm at 0.1 mm of error [deg]."""

FEED_SIGMAS = 6.0
"""Standard deviations by which the overlap must disagree with the feed to count."""


TELLING = 1e-3
"""Largest relative standard deviation of a feed that an overlap determines. A compensated circle has hardly any shape,
so it would match any feed."""

LEAST_SHAPE = 8.2
"""Least variance of the overlap's bent shape over that of its noise. Noise alone exceeds it once in 10,000 times (F distribution
with 6 and 22 degrees of freedom). Less shape matches at any shift: of a machine that stands at a corner, or of a short arc."""

FINEST_STEP_MM = 1e-4
"""Step of readings that no bar resolves more finely [mm]. The shape of computed recordings has no less noise."""

PIECES = 24
"""Number of pieces of the overlap whose means are compared."""

ROUNDS = 8
"""Iterations of the comparison; each reduces the error to a small share."""

SHAPE_ORDER = 7
"""Degree of the polynomial for the slope of the overlap's shape."""

STANDING_S = 0.3
"""Assumed standstill at both ends of the trace [s]."""

LARGEST_JUMP_MM = 0.2
"""Largest change between neighbouring samples [mm]; a machine error of a millimetre per radian moves the bar by 0.1 mm in a second."""

OUTSIDE_FEEDINGS = 6.0
INSIDE_FEEDINGS = 3.0
"""Windows outside and inside an edge for reading its two lengths, in durations of the feed-in."""


def cut(recording: Recording, circle: Circle, counted_lost: int = 0) -> RawCircle:
    """Return the full turn of a recording.

    Recorded angles determine the turn directly. Otherwise the turn is centred between feed-in and feed-out, because
    controls dwell at corners; the programmed feed gives its angles.

    Raises:
        TraceError: no feed-in or feed-out, a gap, a bar off the circle, or another feed; lost samples are named first as a
            possible cause.
    """
    try:
        return _turn(recording, circle)
    except TraceError as error:
        lost = max(lost_samples(recording.t_s), counted_lost)
        if not lost:
            raise
        raise TraceError(
            f"{share_lost(lost, len(recording))}; {error.what}",
            where=error.where,
            remedy=f"{AFTER_LOSS}; if that does not help: {error.remedy}",
        ) from error


def lost_on_turn(recording: Recording, circle: Circle) -> tuple[int, int, int]:
    """Return numbers of missing, present and unusable samples on the turn.

    Unusable samples count as missing. Losses outside the turn are harmless. If no turn is found, samples are missing and
    present in the whole recording, and none is unusable.
    """
    try:
        t_s, found = _turn(recording, circle).t_s, True
    except TraceError:
        t_s, found = recording.t_s, False
    unusable = 0
    if recording.usable is not None:
        within = (recording.t_s >= t_s[0]) & (recording.t_s <= t_s[-1])
        unusable = int(np.count_nonzero(~recording.usable & within))
    return max(lost_samples(t_s), unusable), len(t_s), unusable if found else 0


@once_for_each
def _turn(recording: Recording, circle: Circle) -> RawCircle:
    if recording.theta_deg is not None:
        phi = one_turn_deg(recording.theta_deg, circle)
        return _selected(recording, circle, phi, np.isfinite(phi))
    edges = edges_of(recording, circle)
    phi = progress_deg(recording, circle, edges)
    _check_feed(recording, circle, edges)
    raw = _selected(recording, circle, phi, (phi >= 0.0) & (phi < FULL_TURN_DEG))
    return replace(raw, start_uncertainty_deg=start_uncertainty_deg(recording, circle))


def progress_deg(recording: Recording, circle: Circle, edges: tuple[float, float]) -> Floats:
    """Return each sample's progress by the programmed feed, 0 at the turn's start, shape (n,) [deg]."""
    return FULL_TURN_DEG / 2.0 + (recording.t_s - (edges[0] + edges[1]) / 2.0) * circle.turning_deg_s


def start_uncertainty_deg(recording: Recording, circle: Circle) -> float:
    """Return the standard uncertainty of the midpoint between both edges, as an angle [deg]."""
    # An edge between two samples has the uncertainty spacing / sqrt(12); the mean of two edges has 1 / sqrt(2) of it.
    # Several samples on the feed-in divide it by their number. Negligible values are set to zero.
    spacing_s = float(np.median(np.diff(recording.good.t_s)))
    share = min(1.0, spacing_s / circle.feeding_s)
    found = spacing_s / np.sqrt(24.0) * share * circle.turning_deg_s
    return float(found) if found > NEGLIGIBLE_DEG else 0.0


def edges_of(recording: Recording, circle: Circle) -> tuple[float, float]:
    """Return the times of feed-in and feed-out [s].

    Raises:
        TraceError: one is missing, or less than a turn lies between.
    """
    # Each edge is halfway between the lengths on its sides: a common threshold would shift them by the machine's error,
    # 0.02 degrees for a tenth of a millimetre.
    t, length = recording.good.t_s, recording.good.length_mm
    if not len(t):
        raise TraceError("no sample of it can be used", where=recording.name, remedy="repeat the run")
    # The threshold is half the feed-in below the length at the trace's ends, so a machine error as large as the feed-in
    # does not hide the edge.
    first = _first_below(t, length, circle)
    last = _first_below(t[::-1], length[::-1], circle)
    if first is None or last is None:
        missing = "feed-in" if first is None else "feed-out"
        if _counts_backwards(t, length, circle):
            raise TraceError(
                f"no {missing} found: the length is {length[0]:.3f} mm at the start and {float(np.median(length)):.3f} mm on the "
                f"circle, and a feed-in of {circle.feed_in_mm:g} mm makes it shorter, not longer",
                where=recording.name,
                remedy=f"{COUNTS_BACKWARDS}, and run it again",
            )
        raise TraceError(
            f"no {missing} found: from its {'start' if first is None else 'end'} the length, {length.min():.3f} to "
            f"{length.max():.3f} mm, does not fall by half of the feed-in of {circle.feed_in_mm:g} mm",
            where=recording.name,
            remedy="record from before the feed-in until after the feed-out, and check bar length and feed-in of the "
            "plan",
        )
    edge_in = _edge(t, length, circle, first)
    edge_out = _edge(t[::-1], length[::-1], circle, last)
    travelled = (edge_out - edge_in) * circle.turning_deg_s
    if travelled < FULL_TURN_DEG * (1.0 - SHORTEST_TURN):
        raise TraceError(
            f"only {travelled:.0f} of {circle.swept_deg:.0f} degrees lie between feed-in and feed-out at the programmed "
            f"feed of {circle.feed_mm_min:g} mm/min",
            where=recording.name,
            remedy="record the whole path, or correct feed and overshoot in the plan",
        )
    return edge_in, edge_out


COUNTS_BACKWARDS = "the gauge counts the wrong way round: turn its counting direction at the display or encoder"
"""Cause and remedy if the length grows while the machine feeds in."""


def _counts_backwards(t: Floats, length: Floats, circle: Circle) -> bool:
    ends = (float(np.median(length[np.abs(t - end) <= STANDING_S])) for end in (t[0], t[-1]))
    return all(abs(float(np.median(length)) - end - circle.feed_in_mm) < 0.5 * circle.feed_in_mm for end in ends)


def _first_below(t: Floats, length: Floats, circle: Circle) -> int | None:
    standing = np.abs(t - t[0]) <= STANDING_S
    below = np.flatnonzero(length < float(np.median(length[standing])) - circle.feed_in_mm / 2.0)
    return int(below[0]) if len(below) and below[0] > 0 else None


def _edge(t: Floats, length: Floats, circle: Circle, first: int) -> float:
    """Return the time at which the length is halfway between outside and inside [s]."""
    feeding_s = circle.feeding_s
    after_s = np.abs(t - t[first]) * np.where(np.arange(len(t)) < first, -1.0, 1.0)
    outside = (after_s > -OUTSIDE_FEEDINGS * feeding_s) & (after_s < -feeding_s)
    inside = (after_s > feeding_s) & (after_s < INSIDE_FEEDINGS * feeding_s)
    halfway = circle.bar_mm + circle.feed_in_mm / 2.0
    if outside.any() and inside.any():
        halfway = (float(np.median(length[outside])) + float(np.median(length[inside]))) / 2.0
    below = first + int(np.argmax(length[first - 1 :] < halfway)) - 1
    share = (halfway - length[below - 1]) / (length[below] - length[below - 1])
    return float(t[below - 1] + (t[below] - t[below - 1]) * share)


def _check_feed(recording: Recording, circle: Circle, edges: tuple[float, float]) -> None:
    """Refuse a recording whose duration or overlap contradicts the programmed feed."""
    # Dwells only lengthen a trace. The overlap passes the same places twice.
    duration = edges[1] - edges[0]
    at_least = circle.feed_mm_min * circle.swept_deg / circle.turning_deg_s / duration
    found = overlap_feed(recording, circle, edges)
    if found is None and at_least > (1.0 + FEED_TOLERANCE) * circle.feed_mm_min:
        shown = f"its {duration:.2f} s between feed-in and feed-out need a feed of {at_least:.1f} mm/min or more"
    elif found is not None and feed_off(found, recording, circle, edges) > 1.0:
        shown = f"the overlap shows a feed of {found[0]:.1f} ± {found[1]:.1f} mm/min"
    else:
        return
    raise TraceError(
        f"{shown}, but the plan states {circle.feed_mm_min:g}",
        where=recording.name,
        remedy="set the override on the control to 100 % and run it again; if this feed is intended, state it in the plan",
    )


def feed_off(found: tuple[float, float], recording: Recording, circle: Circle, edges: tuple[float, float]) -> float:
    """Return the error of the overlap's feed, in units of its limit."""
    t, length = recording.good.t_s, recording.good.length_mm
    larger = circle.bar_mm / float(np.median(length[(t > edges[0]) & (t < edges[1])]))
    limit = max(FEED_TOLERANCE * circle.feed_mm_min, FEED_SIGMAS * found[1])
    return min(abs(found[0] - share * circle.feed_mm_min) for share in (1.0, larger)) / limit


def overlap_feed(
    recording: Recording, circle: Circle, edges: tuple[float, float], noise_mm: float = 0.0
) -> tuple[float, float] | None:
    """Return the overlap's feed and standard uncertainty [mm/min]; None if undetermined.

    The search starts at the programmed feed and at the feed computed from the duration.

    Args:
        noise_mm: of the turn; it replaces the scatter of pieces if larger, which understates correlated noise.
    """
    found = _found_feed(recording, circle, edges)
    if found is None:
        return None
    feed, u, of_noise = found
    u = max(u, of_noise * noise_mm)
    return (feed, u) if u <= TELLING * feed else None


@once_for_each
def _found_feed(recording: Recording, circle: Circle, edges: tuple[float, float]) -> tuple[float, float, float] | None:
    """Return feed and standard deviation [mm/min], and standard deviation per mm of white noise [1/min]."""
    turn_s = FULL_TURN_DEG / circle.turning_deg_s
    by_duration_s = (edges[1] - edges[0]) * FULL_TURN_DEG / circle.swept_deg
    middle = (edges[0] + edges[1]) / 2.0
    matches = [
        match for start in (turn_s, by_duration_s) if (match := _match(recording, circle, middle, start)) is not None
    ]
    if not matches:
        return None
    turn, sigma_s, _, of_noise = min(matches, key=lambda match: match[2])
    if sigma_s > TELLING * turn:
        return None
    feed = circle.feed_mm_min * turn_s / turn
    return feed, feed * sigma_s / turn, feed * of_noise / turn


def _match(
    recording: Recording, circle: Circle, middle: float, start_s: float
) -> tuple[float, float, float, float] | None:
    """Return the turn's duration near `start_s` at which both passes match, with its uncertainty."""
    # If the second pass is T later, the passes differ by offset + slope (T - turn). The regression on their common
    # slope is iterated.
    half_s = circle.overshoot_deg / FULL_TURN_DEG * start_s
    t, length = recording.good.t_s - middle, recording.good.length_mm
    # The first pass is about half a turn before the middle. A wrong feed shifts it, so only its inner part is used.
    rows = np.abs(t + start_s / 2.0) < half_s * (1.0 - FEED_SEARCH)
    when, first = t[rows], length[rows]
    if len(when) < PIECES:
        return None
    piece = np.arange(len(when)) * PIECES // len(when)
    slope_of = _slopes(when, piece)
    turn = start_s
    for _ in range(ROUNDS):
        second = np.interp(when + turn, t, length)
        slope, shape = slope_of((first + second) / 2.0)
        columns = np.column_stack([np.ones(PIECES), slope])
        difference = means(second - first, piece)
        (offset, late), *_ = np.linalg.lstsq(columns, difference, rcond=None)
        turn -= float(late)
        # Shifted by so much, the second pass ends before the feed-out.
        if abs(turn - start_s) > FEED_SEARCH * half_s - circle.feeding_s:
            return None
    left = difference - columns @ np.array([offset, late])
    spread = float(np.sum((slope - slope.mean()) ** 2))
    remaining = float(np.sqrt(left @ left / (PIECES - 2)))
    # A straight shape is an offset at any shift. A mean of two samples has a quarter of the variance of their difference,
    # and half of a sample's, which is at least that of rounding [GUM 4.3.7].
    noise = max(remaining**2 / 4.0 * len(when) / PIECES, FINEST_STEP_MM**2 / 12.0 / 2.0)
    if not np.mean(shape[2:] ** 2) > LEAST_SHAPE * noise:
        return None
    # Each piece is the mean of len(when) / PIECES differences of two samples.
    of_noise = float(np.sqrt(2.0 * PIECES / len(when) / spread))
    return turn, remaining / float(np.sqrt(spread)), remaining, of_noise


def _slopes(t_s: Floats, piece: Integers) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Return a function from samples to the slopes of their pieces, and to the coefficients of orthogonal polynomials."""
    middle, half_s = 0.5 * (t_s[0] + t_s[-1]), 0.5 * (t_s[-1] - t_s[0])
    powers = np.polynomial.polynomial.polyvander((t_s - middle) / half_s, SHAPE_ORDER)
    orthogonal, upper = np.linalg.qr(powers)
    rates = powers[:, :-1] * (np.arange(1.0, SHAPE_ORDER + 1.0) / half_s)
    of_rest = np.linalg.solve(upper.T, np.column_stack([np.zeros(PIECES), means(rates, piece)]).T).T
    return lambda values: (of_rest @ (shape := orthogonal.T @ values), shape)


def one_turn_deg(theta_deg: Floats, circle: Circle) -> Floats:
    """Return progress along one turn at recorded angles, NaN outside, shape (n,) [deg].

    From a longer run, the first whole turn from the plan's start is selected, else the middle one. Samples slightly
    beyond the ends do not wrap around.
    """
    travelled = circle.direction.sign * (np.unwrap(theta_deg, period=FULL_TURN_DEG) - circle.start_deg)
    first, last = float(travelled.min()), float(travelled.max())
    spacing = float(np.median(np.abs(np.diff(travelled)))) if len(travelled) > 1 else 0.0
    if last - first < FULL_TURN_DEG - WRITTEN_DEG:
        turn = FULL_TURN_DEG * round(first / FULL_TURN_DEG)
        return travelled - turn if abs(first - turn) <= LARGEST_GAP_DEG else np.mod(travelled, FULL_TURN_DEG)
    turn = FULL_TURN_DEG * float(np.ceil((first - spacing) / FULL_TURN_DEG))
    begins_there = turn + FULL_TURN_DEG <= last + spacing
    begin = turn if begins_there else 0.5 * (first + last - FULL_TURN_DEG)
    inside = (travelled >= begin - WRITTEN_DEG) & (travelled < begin + FULL_TURN_DEG - WRITTEN_DEG)
    phi = travelled - turn if begins_there else np.mod(travelled, FULL_TURN_DEG)
    return np.where(inside, phi, np.nan)


def _selected(recording: Recording, circle: Circle, phi_deg: Floats, rows: Flags) -> RawCircle:
    if recording.usable is not None:
        rows = rows & recording.usable
    phi = phi_deg[rows]
    gaps = np.diff(np.sort(phi), prepend=0.0, append=FULL_TURN_DEG)
    if gaps.max() > LARGEST_GAP_DEG:
        start = float(np.concatenate([[0.0], np.sort(phi)])[int(np.argmax(gaps))])
        raise TraceError(
            f"no sample over {gaps.max():.1f} degrees; the gap begins {start:.1f} degrees after the start of the turn",
            where=recording.name,
            remedy="repeat the run",
        )
    length = recording.length_mm[rows]
    jumps = np.abs(np.diff(length))
    if jumps.max(initial=0.0) > LARGEST_JUMP_MM:
        worst = int(np.argmax(jumps))
        raise TraceError(
            f"the length jumps by {jumps[worst]:.3f} mm from one sample to the next, at "
            f"{circle.theta_deg(phi)[worst] % FULL_TURN_DEG:.1f} degrees",
            where=recording.name,
            remedy="check balls, cups and cable, and repeat the run",
        )
    off = np.abs(length - circle.bar_mm)
    # Recorded angles need no edges, so only the bar's travel limits the machine's error.
    timed = recording.theta_deg is None
    if off.max() > (circle.feed_in_mm if timed else USUAL_STROKE_MM):
        worst = int(np.argmax(off))
        coarser = "raise feed_in_mm, or begin with a coarse calibration from recordings with theta_deg"
        raise TraceError(
            f"the length is {length[worst]:.3f} mm, {off[worst]:.3f} mm off the bar's {circle.bar_mm:g} mm, at "
            f"{circle.theta_deg(phi)[worst] % FULL_TURN_DEG:.1f} degrees",
            where=recording.name,
            remedy="check bar length, units and plan; repeat the run if a ball left its seat; if the machine itself errs so much: "
            f"{coarser if timed else 'set its reference lengths first'}",
        )
    return RawCircle(
        name=recording.name,
        circle=circle,
        t_s=recording.t_s[rows],
        phi_deg=phi,
        length_mm=length,
        logged=each(recording.logged, lambda values: values[rows]),
    )


LEFT_OUT_DEG = 2.0
"""Ignored arc beside a corner, where the machine accelerates or brakes [deg]. Acceleration to 1000 mm/min at 1 m/s²
takes 20 ms, which is less; a dwell of 0.3 s shifts angles by less, too."""

READ_DEG = 20.0
"""Following arc, whose readings give the length at the corner [deg]; low undulations are at most parabolic on it."""

SHAPE = 2
"""Degree of the polynomial through the readings of that arc."""

FEWEST = 8
"""Fewest readings of an arc: five more than the polynomial's coefficients."""


@dataclass(frozen=True)
class FeedingWay:
    """A feed-in or a feed-out.

    Attributes:
        way_um: length outside less length at the corner.
    """

    phi_deg: float
    way_um: float
    u_um: float


def feeding_ways(
    recording: Recording, circle: Circle, edges: tuple[float, float]
) -> tuple[FeedingWay, FeedingWay] | None:
    """Return the measured feed-in and feed-out, or None for too few samples."""
    good = recording.good
    phi = progress_deg(good, circle, edges)
    begin = _way(good, circle, good.t_s - edges[0], phi + circle.overshoot_deg)
    end = _way(good, circle, edges[1] - good.t_s, circle.swept_deg - circle.overshoot_deg - phi)
    if begin is None or end is None:
        return None
    return FeedingWay(-circle.overshoot_deg, *begin), FeedingWay(circle.swept_deg - circle.overshoot_deg, *end)


def _way(recording: Recording, circle: Circle, behind_s: Floats, along_deg: Floats) -> tuple[float, float] | None:
    outside = recording.length_mm[(behind_s > -OUTSIDE_FEEDINGS * circle.feeding_s) & (behind_s < -circle.feeding_s)]
    chosen = (along_deg > LEFT_OUT_DEG) & (along_deg < LEFT_OUT_DEG + READ_DEG)
    if not len(outside) or np.count_nonzero(chosen) < FEWEST:
        return None
    columns = np.vander(along_deg[chosen] / READ_DEG, SHAPE + 1, increasing=True)
    found, *_ = np.linalg.lstsq(columns, recording.length_mm[chosen], rcond=None)
    left = recording.length_mm[chosen] - columns @ found
    sigma = float(np.sqrt(left @ left / (len(left) - SHAPE - 1)))
    at_corner = sigma * float(np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0]))
    # The machine may move outside, so the scatter of readings there counts in full, not divided by sqrt(n).
    scatter = float(np.std(outside)) if len(outside) > 1 else sigma
    return 1e3 * (float(np.median(outside)) - float(found[0])), 1e3 * float(np.hypot(at_corner, scatter))
