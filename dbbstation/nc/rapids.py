"""Where the rapids of a compensated program stop between each other, so that they are as fast as those of the nominal one.

A rapid whose A, B and C are corrected turns by some thousandths of a degree. LinuxCNC lets it overlap with the rapids beside it, and
plans it with half the acceleration for that (`planned_time`), where it fitted arcs into the corners before. Where it stops at its ends,
as it does before a move at feed anyway, it has all of the acceleration.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.planned_time import seconds_of, segments_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.planner import Planner
    from dbbstation.nc.toolpath import Toolpath

WORTH_A_STOP = (1.0 - np.sqrt(0.5)) ** 2
"""Share of L·sin(φ/2), for a rapid of length L with a corner of φ behind it, up to which the bound P of that corner makes a stop worth while:
2·√(2L/a) - 2·√(L/a) is gained by the stop, 2·√(2P/(a·sin(φ/2))) by the overlap."""


def corners_mm(
    done: Toolpath, turned: NDArray[np.bool_], planner: Planner, fastest_mm_min: float
) -> NDArray[np.float64]:
    """Return the bounds of the corners of a compensated toolpath, shape (n,) [mm]: 0 between rapids that are quicker with a stop.

    Of rapids that follow each other none, all or those at tight corners stop, whatever is quickest. Nothing is changed where one of them turns by itself, or where the program does not
    say how far corners may be rounded: what holds then is not known, and could not be written again.

    Args:
        done: compensated.
        turned: rows that moved A, B or C before they were compensated, shape (n,).
        planner: the control on its machine.
        fastest_mm_min: speed of a rapid [mm/min].
    """
    rows = np.flatnonzero((done.kind == RowKind.RAPID) & (done.tip_mm > 0.0))
    if planner.look_ahead is None or len(rows) < 2:  # noqa: PLR2004 - a pair
        return done.corners_mm
    fast = np.full(len(done), fastest_mm_min)
    as_fast = replace(done, feed_mm_min=fast, feed_deg_min=fast, arc=None)
    a = planner.acceleration_mm_s2
    segments = segments_of(as_fast, rows, done.turn_deg > 0.0, a)
    alone = planner.reached_mm_s(segments.length_mm)
    run = np.concatenate([[0], np.cumsum(~segments.goes_on)])
    # None stop, all do, or those whose corner is too tight for an overlap to be worth half the acceleration.
    shorter_mm = np.minimum(segments.length_mm[1:], segments.length_mm[:-1])
    tight = segments.allowed_mm < WORTH_A_STOP * shorter_mm * segments.half_sine
    ways = [segments.goes_on & stop for stop in (np.zeros_like(tight), np.ones_like(tight), tight)]
    each_s = (
        seconds_of(replace(segments, goes_on=segments.goes_on & ~stop), a, planner.look_ahead.cycle_s, alone)
        for stop in ways
    )
    best = np.argmin([np.bincount(run, weights=seconds) for seconds in each_s], axis=0)
    told = np.bincount(run, weights=turned[rows] | np.isnan(done.corners_mm[rows])) == 0.0
    stops = np.choose(best[run[:-1]], ways) & told[run[:-1]]
    corners = done.corners_mm.copy()
    corners[rows[:-1][stops]] = 0.0
    return corners
