"""Which places of a curve to join by straight pieces: the longest that stay near it, or the nearest of a least length.

Both are paths through a graph whose nodes are the places and whose edges are the pieces between them, found in order of the
places. The first has the longest shortest piece of all, which decides the feed, and among those with that the fewest pieces;
the second has the smallest greatest distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

OF_LEAST = 16.0
"""Places to choose from in each least length of a piece."""


def longest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    tolerance_mm: float,
) -> NDArray[np.int64]:
    """Places at which pieces end, whose shortest is as long as can be while the curve stays within the tolerance.

    From each place a piece to the next that it may end at is allowed, whatever lies between: a step has no piece that fits.

    Args:
        way: along the curve at each place, rising, shape (n,).
        curve: points at these places, in which distances are the root of the sum of squares of the first three, or of the
            others where that is more, shape (n, 6) [mm].
        may_end: where pieces may end; at the first and the last place they do anyway, shape (n,).
        tolerance_mm: greatest distance of a place from the point of its piece at the same share of the way.

    Returns:
        Numbers of places, rising, the last one among them and the first one not.
    """
    arrays = _arrays(way, curve, may_end)
    return _traced(_fewest(*arrays, tolerance_mm, _longest(*arrays, tolerance_mm)))


def truest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    least: float,
) -> NDArray[np.int64]:
    """Places at which pieces end that are no shorter than `least`, and as near to the curve as can be.

    Where all of the curve is shorter, it is one piece. Other arguments and the answer as for `longest`.
    """
    way, curve, ends = _arrays(way, curve, may_end)
    # Some places for each length are enough to choose from.
    if least > 0.0:
        some = np.flatnonzero(ends)
        part = np.floor(OF_LEAST * (way[some] - way[0]) / least)
        ends[some[1:-1]] = part[1:-1] != part[:-2]
    return _traced(_truest(way, curve, ends, least))


def _arrays(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    ends = may_end.copy()
    ends[-1] = True
    return np.ascontiguousarray(way), np.ascontiguousarray(curve), ends


def _traced(before: NDArray[np.int64]) -> NDArray[np.int64]:
    found = [len(before) - 1]
    while before[found[-1]] > 0:
        found.append(int(before[found[-1]]))
    return np.array(found[::-1], dtype=np.int64)


@compiled
def _distance_mm(way: NDArray[np.float64], curve: NDArray[np.float64], start: int, end: int) -> float:
    """Greatest distance of the places between two from the straight piece that joins them."""
    worst = 0.0
    length = way[end] - way[start]
    for k in range(start + 1, end):
        share = (way[k] - way[start]) / length
        moved = turned = 0.0
        for axis in range(3):
            off = curve[k, axis] - curve[start, axis] - share * (curve[end, axis] - curve[start, axis])
            moved += off * off
        for axis in range(3, 6):
            off = curve[k, axis] - curve[start, axis] - share * (curve[end, axis] - curve[start, axis])
            turned += off * off
        worst = max(worst, moved, turned)
    return float(np.sqrt(worst))


@compiled
def _longest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    tolerance_mm: float,
) -> float:
    count = len(way)
    best = np.full(count, -1.0)
    best[0] = np.inf
    for start in range(count - 1):
        if best[start] < 0.0:
            continue
        first = True
        for end in range(start + 1, count):
            if not may_end[end]:
                continue
            if not first and _distance_mm(way, curve, start, end) > tolerance_mm:
                break
            first = False
            best[end] = max(best[end], min(best[start], way[end] - way[start]))
    return float(best[-1])


@compiled
def _fewest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    tolerance_mm: float,
    least: float,
) -> NDArray[np.int64]:
    """The place before each on the way there with the fewest pieces, none shorter than `least`."""
    count = len(way)
    pieces = np.full(count, count + 1)
    before = np.zeros(count, np.int64)
    pieces[0] = 0
    for start in range(count - 1):
        if pieces[start] > count:
            continue
        first = True
        for end in range(start + 1, count):
            if not may_end[end]:
                continue
            if not first and _distance_mm(way, curve, start, end) > tolerance_mm:
                break
            first = False
            if way[end] - way[start] >= least and pieces[start] + 1 < pieces[end]:
                pieces[end] = pieces[start] + 1
                before[end] = start
    return before


@compiled
def _truest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    least: float,
) -> NDArray[np.int64]:
    count = len(way)
    best = np.full(count, np.inf)
    before = np.zeros(count, np.int64)
    best[0] = 0.0
    for start in range(count - 1):
        if best[start] == np.inf:
            continue
        first = True
        for end in range(start + 1, count):
            length = way[end] - way[start]
            if not may_end[end] or length < least:
                continue
            # A piece of twice the least length can be two; the third is for what is left at the end.
            if not first and length > 3.0 * least:
                break
            first = False
            distance_mm = max(best[start], _distance_mm(way, curve, start, end))
            if distance_mm < best[end]:
                best[end] = distance_mm
                before[end] = start
    return before
