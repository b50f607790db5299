"""Compute times and angles of a run in the machine's frame; missing ones follow from the plan's feed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import median_of, range_of, sum_of
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.cut import LARGEST_GAP_DEG

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.mapping import AngleSchema

LONGEST_START_S = 3600.0
"""Times that begin later or below 0 are clock times [s]; they are then counted from the first sample."""

UNLIKE_FEED = 0.05
"""Largest relative difference between the recorded feed and the plan's that is not reported. In known recordings, ramps
and dwells of a control are less than a hundredth of a turn's time."""

LEAST_TURN = 0.99
"""Least share of a turn that the times must cover at the plan's feed; less means that the feed differs."""


UNLIKE_SPAN_DEG = 2.0
"""Largest difference of a range of angles [deg]: controls may cut a degree of the first or last move."""


class UnusableTravelError(Exception):
    """Impossible times or angles."""

    def __init__(self, what: str, remedy: str) -> None:
        self.what, self.remedy = what, remedy
        super().__init__(what)


@dataclass(frozen=True, eq=False)
class TravelledPath:
    """Times and angles of a run's samples.

    Attributes:
        theta_deg: from +X towards +Y, shape (n,); None: find the circle in the trace.
        computed: values that the file lacks, in words.
    """

    t_s: Floats
    theta_deg: Floats | None
    rows: Integers
    computed: tuple[str, ...] = ()


def rises(angle_deg: Floats) -> bool:
    """Return whether angles grow, apart from steps of a turn."""
    return sum_of(np.diff(_unwrapped(angle_deg))) > 0.0


def machine_angles(angle_deg: Floats, said: AngleSchema, circle: Circle) -> Floats:
    """Return machine angles from +X towards +Y, shape (n,) [deg].

    Args:
        said: zero and sense of the file's angles.

    Raises:
        UnusableTravelError: the angles turn against the run's direction.
    """
    sense = circle.direction.sign if said.grows == "travel" else Direction(said.grows).sign
    zero = circle.start_deg if said.zero_deg is None else said.zero_deg
    theta = zero + sense * angle_deg
    if len(theta) > 1 and rises(theta) != (circle.direction is Direction.CCW):
        raise UnusableTravelError(
            f"the angles turn against {circle.direction}",
            "check the direction of the run, and `angle: grows` of the mapping",
        )
    return theta


def unplanned_span_deg(theta_deg: Floats, circle: Circle) -> float | None:
    """Return the range of the angles [deg] if it is neither a turn nor the plan's path with overshoot, else None."""
    travelled = _unwrapped(theta_deg)
    spacing = median_of(np.abs(np.diff(travelled))) if len(travelled) > 1 else 0.0
    span = range_of(travelled)
    if span + spacing < FULL_TURN_DEG - LARGEST_GAP_DEG:
        return None  # no turn at all: cutting refuses it, and has more to say
    near = max(UNLIKE_SPAN_DEG, 2.0 * spacing)
    # A turn has its last sample at its end, or one spacing before it.
    planned = (FULL_TURN_DEG, FULL_TURN_DEG - spacing, circle.swept_deg)
    return None if any(abs(span - one) <= near for one in planned) else span + spacing


def check_span(theta_deg: Floats, stated_deg: float | None, circle: Circle) -> tuple[str, ...]:
    """Return notes on a confirmed range that differs from the plan's.

    Args:
        stated_deg: confirmed range; None if not confirmed.

    Raises:
        UnusableTravelError: an unconfirmed span other than the plan's.
    """
    span = unplanned_span_deg(theta_deg, circle)
    if span is None:
        return ()
    if stated_deg is None or abs(span - stated_deg) > UNLIKE_SPAN_DEG:
        path = "" if circle.overshoot_deg == 0.0 else f", with its overshoot {circle.swept_deg:g}"
        raise UnusableTravelError(
            f"the angles span {span:.0f} degrees, a turn of the plan has {FULL_TURN_DEG:g}{path}",
            f"if this span is right, give --angle-span-deg {span:.0f}; the import then uses one turn of it. Else check plan and file",
        )
    return (f"its angles span {span:.0f} degrees, as was confirmed; one turn of them is used",)


def travel(t_s: Floats | None, theta_deg: Floats | None, circle: Circle, trace: str | None) -> TravelledPath:
    """Return a run's times and angles.

    Args:
        trace: extent of a trace without angles: `whole` or `turn`.

    Raises:
        UnusableTravelError: both are missing, times do not rise, or they are too short for a turn.
    """
    if t_s is None:
        if theta_deg is None:
            raise UnusableTravelError("there are neither times nor angles", "export one of them")
        return _from_angles(theta_deg, circle)
    timed, computed = _from_zero(t_s)
    rows = np.arange(len(timed))
    if theta_deg is not None:
        return TravelledPath(timed, theta_deg, rows, (*computed, *_feed_note(timed, theta_deg, circle)))
    if trace is None:
        raise UnusableTravelError("this run has no angles", "say in the mapping: `trace: whole`, or `turn`")
    return TravelledPath(timed, None, rows, computed) if trace == "whole" else _turn(timed, circle, computed)


def _from_angles(theta_deg: Floats, circle: Circle) -> TravelledPath:
    progress = circle.direction.sign * (_unwrapped(theta_deg) - theta_deg[0])
    still = np.flatnonzero(np.diff(progress) <= 0.0)
    if len(still):
        what = f"the angle stands still or turns back in row {still[0] + 2} of the run, and there are no times"
        raise UnusableTravelError(what, "export the times too, or remove these rows")
    said = f"times: computed from the angles {_at(circle)}"
    return TravelledPath(progress / circle.turning_deg_s, theta_deg, np.arange(len(theta_deg)), (said,))


def _from_zero(t_s: Floats) -> tuple[Floats, tuple[str, ...]]:
    back = np.flatnonzero(np.diff(t_s) <= 0.0)
    if len(back):
        k = int(back[0]) + 1
        what = f"time runs backwards or stands still in row {k + 1} of the run: {t_s[k]:g} s after {t_s[k - 1]:g} s"
        raise UnusableTravelError(what, "check that the rows are those of one run, in order")
    if 0.0 <= t_s[0] <= LONGEST_START_S:
        return t_s, ()
    return t_s - t_s[0], ("times: counted from the first sample of each run, before that they are those of a clock",)


def _turn(t_s: Floats, circle: Circle, computed: tuple[str, ...]) -> TravelledPath:
    progress = (t_s - t_s[0]) * circle.turning_deg_s
    if progress[-1] < LEAST_TURN * FULL_TURN_DEG:
        turn_s = FULL_TURN_DEG / circle.turning_deg_s
        what = f"the times span {t_s[-1] - t_s[0]:.2f} s, a turn takes {turn_s:.2f} s {_at(circle)}"
        raise UnusableTravelError(what, "set the plan's feed to the actual feed, or check the unit of the times")
    rows = np.flatnonzero(progress < FULL_TURN_DEG)
    said = f"angles: computed from the times {_at(circle)}, the first sample at {circle.start_deg:g} degrees"
    beyond = len(t_s) - len(rows)
    more = (f"{beyond} samples beyond the full turn are left out",) if beyond else ()
    return TravelledPath(t_s[rows], circle.theta_deg(progress[rows]), rows, (*computed, said, *more))


def _feed_note(t_s: Floats, theta_deg: Floats, circle: Circle) -> tuple[str, ...]:
    if len(t_s) < 2:  # noqa: PLR2004 - one sample has no speed
        return ()
    turned = abs(sum_of(np.diff(_unwrapped(theta_deg))))
    feed = circle.feed_mm_min * turned / float(t_s[-1] - t_s[0]) / circle.turning_deg_s
    if abs(feed / circle.feed_mm_min - 1.0) <= UNLIKE_FEED:
        return ()
    return (f"note: times and angles make a feed of {feed:.0f} mm/min, but the plan states {circle.feed_mm_min:g}",)


def _at(circle: Circle) -> str:
    return f"at the plan's feed of {circle.feed_mm_min:g} mm/min"


def _unwrapped(theta_deg: Floats) -> Floats:
    return np.unwrap(theta_deg, period=FULL_TURN_DEG)
