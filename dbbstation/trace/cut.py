"""Cutting the full turn out of a recording that also holds feed-in, overshoot and feed-out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.average import means
from dbbstation.trace.circle import RawCircle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.trace.recording import Recording

LARGEST_GAP_DEG = 10.0
"""A wider stretch without a sample is not a full circle any more."""

FEED_SEARCH = 0.2
"""The feed that a trace shows is looked for within this share of the programmed one."""

FEED_TOLERANCE = 2e-3
"""Share of the feed that a recording may be off; one per thousand costs 0.3 µm at 100 µm of error per radian, and
real overlaps, which friction and warming keep from agreeing exactly, scatter by as much."""

FEED_SIGMAS = 6.0
"""A disagreement counts only where the overlap shows it this clearly above its noise."""


TELLING = 1e-3
"""Share of the feed that an overlap must determine it to, one standard deviation, to be asked at all: a compensated
circle has hardly any shape left, and what is left of it would say any feed."""

PIECES = 24
"""Stretches of the overlap that are compared; what differs within one counts as one."""

ROUNDS = 8
"""Rounds of the comparison: each leaves a small share of what the one before was off by."""

SHAPE_ORDER = 7
"""Degree of the polynomial that gives the slope of the overlap's shape."""

OUTSIDE_FEEDINGS = 6.0
INSIDE_FEEDINGS = 3.0
"""How far from an edge, in durations of the feed-in, its two levels are read."""


def cut(recording: Recording, circle: Circle) -> RawCircle:
    """Return the full turn of a recording.

    Rows with angles are taken as they are: they are cut already. Otherwise the turn is anchored midway between
    feed-in and feed-out, and angles follow from the programmed feed: controls dwell at the corners, so the
    trace's duration says little.

    Raises:
        TraceError: no feed-in or feed-out, a gap, a bar that left the circle, or a feed that is not the
            programmed one.
    """
    if recording.theta_deg is not None:
        return _selected(recording, circle, circle.phi_deg(recording.theta_deg), np.ones(len(recording), dtype=bool))
    middle = _middle(recording, circle)
    phi = FULL_TURN_DEG / 2.0 + (recording.t_s - middle) * circle.turning_deg_s
    _check_feed(recording, circle, middle)
    return _selected(recording, circle, phi, (phi >= 0.0) & (phi < FULL_TURN_DEG))


def _middle(recording: Recording, circle: Circle) -> float:
    """Time midway between the edges of feed-in and feed-out [s].

    The edges lie at different angles, so the machine's own error there, a tenth of a millimetre or more, would move
    them by different amounts against one common threshold: by 0.02 degrees, which costs more than the noise of a
    whole run. Each edge is therefore taken halfway between the lengths on its two sides.
    """
    threshold = circle.bar_mm + circle.feed_in_mm / 2.0
    inside = np.flatnonzero(recording.length_mm < threshold)
    if len(inside) == 0 or inside[0] == 0 or inside[-1] == len(recording) - 1:
        missing = "feed-out" if len(inside) and inside[0] > 0 else "feed-in"
        low, high = recording.length_mm.min(), recording.length_mm.max()
        raise TraceError(
            f"no {missing} found: the length, {low:.3f} to {high:.3f} mm, never crosses {threshold:.3f} mm there",
            where=recording.name,
            remedy="record from before the feed-in until after the feed-out, and check bar length and feed-in of the "
            "plan",
        )
    edge_in = _edge(recording.t_s, recording.length_mm, circle, int(inside[0]))
    backwards = recording.t_s[::-1], recording.length_mm[::-1]
    edge_out = _edge(*backwards, circle, len(recording) - 1 - int(inside[-1]))
    travelled = (edge_out - edge_in) * circle.turning_deg_s
    if travelled < circle.swept_deg * (1.0 - FEED_SEARCH):
        raise TraceError(
            f"only {travelled:.0f} of {circle.swept_deg:.0f} degrees lie between feed-in and feed-out at the programmed "
            f"feed of {circle.feed_mm_min:g} mm/min",
            where=recording.name,
            remedy="record the whole path, or correct feed and overshoot in the plan",
        )
    return (edge_in + edge_out) / 2.0


def _edge(t: NDArray[np.float64], length: NDArray[np.float64], circle: Circle, first: int) -> float:
    """Time of an edge, seen on the way in: halfway between the lengths outside and inside of it [s].

    Args:
        t: times, rising or falling, shape (n,) [s].
        length: lengths, shape (n,) [mm].
        circle: as commanded.
        first: index of the first sample below half the feed-in.
    """
    feeding_s = circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    after_s = np.abs(t - t[first]) * np.where(np.arange(len(t)) < first, -1.0, 1.0)
    outside = (after_s > -OUTSIDE_FEEDINGS * feeding_s) & (after_s < -feeding_s)
    inside = (after_s > feeding_s) & (after_s < INSIDE_FEEDINGS * feeding_s)
    halfway = circle.bar_mm + circle.feed_in_mm / 2.0
    if outside.any() and inside.any():
        halfway = (float(np.median(length[outside])) + float(np.median(length[inside]))) / 2.0
    below = first + int(np.argmax(length[first - 1 :] < halfway)) - 1
    share = (halfway - length[below - 1]) / (length[below] - length[below - 1])
    return float(t[below - 1] + (t[below] - t[below - 1]) * share)


def _check_feed(recording: Recording, circle: Circle, middle: float) -> None:
    """Compare the feed with the one that the overlap shows: the same places are passed twice, a turn apart."""
    found = overlap_feed(recording, circle, middle)
    if found is None:
        return
    feed, uncertainty = found
    off = abs(feed - circle.feed_mm_min)
    if off > max(FEED_TOLERANCE * circle.feed_mm_min, FEED_SIGMAS * uncertainty):
        raise TraceError(
            f"the overlap shows a feed of {feed:.1f} ± {uncertainty:.1f} mm/min, the plan says {circle.feed_mm_min:g}",
            where=recording.name,
            remedy="set the feed of this test in the plan to the one that was run",
        )


def overlap_feed(recording: Recording, circle: Circle, middle: float) -> tuple[float, float] | None:
    """Feed and its standard deviation [mm/min] that make both passes of the overlap agree.

    Where the second pass comes a time T after the first, their difference is offset + slope (T - turn): a regression
    on the slope of the common shape gives what T is off by, and its uncertainty; a few rounds settle it.

    Returns:
        None where the overlap cannot tell: too few samples, or a trace too round to show a shift.
    """
    turn_s = FULL_TURN_DEG / circle.turning_deg_s
    half_s = circle.overshoot_deg / circle.turning_deg_s
    t, length = recording.t_s - middle, recording.length_mm
    # The first pass lies about half a turn before the middle; a wrong feed moves it, so its inner part is used.
    rows = np.abs(t + turn_s / 2.0) < half_s * (1.0 - FEED_SEARCH)
    when, first = t[rows], length[rows]
    if len(when) < PIECES:
        return None
    piece = np.arange(len(when)) * PIECES // len(when)
    turn = turn_s
    for _ in range(ROUNDS):
        second = np.interp(when + turn, t, length)
        shape = np.polynomial.Polynomial.fit(when, (first + second) / 2.0, SHAPE_ORDER)
        slope = means(shape.deriv()(when), piece)
        columns = np.column_stack([np.ones(PIECES), slope])
        difference = means(second - first, piece)
        (_, late), *_ = np.linalg.lstsq(columns, difference, rcond=None)
        turn -= float(late)
        if abs(turn - turn_s) > FEED_SEARCH * half_s:
            return None
    left = difference - columns @ np.linalg.lstsq(columns, difference, rcond=None)[0]
    spread = np.sum((slope - slope.mean()) ** 2)
    sigma_s = float(np.sqrt(left @ left / (PIECES - 2) / spread)) if spread > 0.0 else np.inf
    if sigma_s > TELLING * turn_s:
        return None
    feed = circle.feed_mm_min * turn_s / turn
    return feed, feed * sigma_s / turn


def _selected(recording: Recording, circle: Circle, phi_deg: NDArray[np.float64], rows: NDArray[np.bool_]) -> RawCircle:
    """Rows of the turn that the instrument called usable, refused where the turn has holes or the bar left it."""
    if recording.usable is not None:
        rows = rows & recording.usable
    phi = phi_deg[rows]
    gaps = np.diff(np.sort(phi), prepend=0.0, append=FULL_TURN_DEG)
    if gaps.max() > LARGEST_GAP_DEG:
        start = float(np.concatenate([[0.0], np.sort(phi)])[int(np.argmax(gaps))])
        raise TraceError(
            f"no sample over {gaps.max():.1f} degrees, from {start:.1f} degrees after the start of the turn",
            where=recording.name,
            remedy="repeat the run",
        )
    length = recording.length_mm[rows]
    off = np.abs(length - circle.bar_mm)
    if off.max() > circle.feed_in_mm / 2.0:
        worst = int(np.argmax(off))
        raise TraceError(
            f"the length is {length[worst]:.3f} mm, {off[worst]:.3f} mm off the bar's {circle.bar_mm:g} mm, at "
            f"{circle.theta_deg(phi)[worst] % FULL_TURN_DEG:.1f} degrees",
            where=recording.name,
            remedy="check bar length, units and plan; a ball that left its seat means repeating the run",
        )
    return RawCircle(
        name=recording.name,
        circle=circle,
        t_s=recording.t_s[rows],
        phi_deg=phi,
        length_mm=length,
        temperature_degc={sensor: values[rows] for sensor, values in recording.temperature_degc.items()},
        motor_current_a=None if recording.motor_current_a is None else recording.motor_current_a[rows],
    )
