"""The rapids of a compensated program: stop or join them, whichever is quicker.

A corrected rapid turns A, B and C a little. LinuxCNC then plans it with half the acceleration and overlaps it with its
neighbours (`planned_time`). With stops at its ends it has all of the acceleration.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.planned_time import seconds_of, segments_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.planned_time import Segments
    from dbbstation.nc.planner import LookAhead, Planner
    from dbbstation.nc.toolpath import Toolpath

WORTH_A_STOP = (1.0 - np.sqrt(0.5)) ** 2
"""Share of L·sin(φ/2), for a rapid of length L with a corner of φ behind it, up to which the bound P of that corner makes a stop worth while:
2·√(2L/a) - 2·√(L/a) is gained by the stop, 2·√(2P/(a·sin(φ/2))) by the overlap."""


SAME_WAY = 1e-6
"""Two rapids are one where their unit vectors differ by no more: what rounding to six decimals makes of lines of a metre."""


def go_on(toolpath: Toolpath) -> NDArray[np.bool_]:
    """Return rapids that continue in direction, work system and path control, shape (n,).

    LinuxCNC runs such rapids as one, and would stop between them if A, B and C were corrected.
    """
    plain = (toolpath.kind == RowKind.RAPID) & (toolpath.tip_mm > 0.0) & (toolpath.turn_deg == 0.0)
    way = np.where(plain[:, None], toolpath.poses[:, :3] - toolpath.before[:, :3], 0.0)
    unit = way / np.where(plain, toolpath.tip_mm, 1.0)[:, None]
    same = np.linalg.norm(unit[1:] - unit[:-1], axis=1) <= SAME_WAY
    same &= (toolpath.system[1:] == toolpath.system[:-1]) & (toolpath.frame[1:] == toolpath.frame[:-1]).all(axis=1)
    corner = np.where(np.isnan(toolpath.corners_mm), -1.0, toolpath.corners_mm)  # NaN is no other than NaN
    same &= corner[1:] == corner[:-1]
    goes_on = np.append(plain[1:] & plain[:-1] & same, False)[: len(plain)]
    goes_on[list(toolpath.text)] = False
    return goes_on


def seconds(toolpath: Toolpath, planner: Planner, fastest_mm_min: float) -> float:
    """Return the time of all rapids that move the tool tip [s]."""
    rows = _rows(toolpath)
    if planner.look_ahead is None or len(rows) == 0:
        return 0.0
    segments = _segments(toolpath, rows, planner, fastest_mm_min)
    return float(_each_s(segments, planner, planner.look_ahead).sum())


def _rows(toolpath: Toolpath) -> NDArray[np.int64]:
    return np.flatnonzero((toolpath.kind == RowKind.RAPID) & (toolpath.tip_mm > 0.0))


def _each_s(segments: Segments, planner: Planner, look_ahead: LookAhead) -> NDArray[np.float64]:
    """Time of each row of the segments [s]."""
    alone = planner.reached_mm_s(segments.length_mm)
    return seconds_of(segments, planner.acceleration_mm_s2, look_ahead.cycle_s, alone)


def _segments(toolpath: Toolpath, rows: NDArray[np.int64], planner: Planner, fastest_mm_min: float) -> Segments:
    fast = np.full(len(toolpath), fastest_mm_min)
    as_fast = replace(toolpath, feed_mm_min=fast, feed_deg_min=fast, arc=None)
    return segments_of(as_fast, rows, toolpath.turn_deg > 0.0, planner.acceleration_mm_s2)


def corners_mm(
    done: Toolpath, turned: NDArray[np.bool_], planner: Planner, fastest_mm_min: float
) -> NDArray[np.float64]:
    """Return the bounds of corners, shape (n,) [mm]: 0 between rapids that are quicker with a stop.

    Of successive rapids none, all or those at tight corners stop. Nothing changes if one turns by itself or the program
    states no tolerance.

    Args:
        turned: rows that moved A, B or C before compensation, shape (n,).
    """
    rows = _rows(done)
    if planner.look_ahead is None or len(rows) < 2:  # noqa: PLR2004 - a pair
        return done.corners_mm
    segments = _segments(done, rows, planner, fastest_mm_min)
    run = np.concatenate([[0], np.cumsum(~segments.goes_on)])
    # None stop, all do, or those whose corner is too tight for an overlap to be worth half the acceleration.
    shorter_mm = np.minimum(segments.length_mm[1:], segments.length_mm[:-1])
    tight = segments.allowed_mm < WORTH_A_STOP * shorter_mm * segments.half_sine
    ways = [segments.goes_on & stop for stop in (np.zeros_like(tight), np.ones_like(tight), tight)]
    each_s = (
        _each_s(replace(segments, goes_on=segments.goes_on & ~stop), planner, planner.look_ahead) for stop in ways
    )
    best = np.argmin([np.bincount(run, weights=each) for each in each_s], axis=0)
    told = np.bincount(run, weights=turned[rows] | np.isnan(done.corners_mm[rows])) == 0.0
    stops = np.choose(best[run[:-1]], ways) & told[run[:-1]]
    corners = done.corners_mm.copy()
    corners[rows[:-1][stops]] = 0.0
    return corners
