"""Choose the places of a curve to join by straight pieces: a path through a graph with places as nodes and pieces as edges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray


def longest(
    way: NDArray[np.float64],
    curve: NDArray[np.float64],
    may_end: NDArray[np.bool_],
    tolerance_mm: float,
) -> NDArray[np.int64]:
    """Return where pieces end: the shortest, which decides the feed, as long as the tolerance allows, then as few as possible.

    A piece to the next allowed end is always possible, even across a step.

    Args:
        way: along the curve at each place, rising, shape (n,).
        curve: points whose distance is that of the first three or the last three coordinates, the larger, shape (n, 6) [mm].
        may_end: where pieces may end, besides first and last place, shape (n,).
        tolerance_mm: from a place to the point of its piece at the same share of the way.

    Returns:
        Numbers of places, rising, the last one among them and the first one not.
    """
    ends = may_end.copy()
    ends[-1] = True
    way, curve = np.ascontiguousarray(way), np.ascontiguousarray(curve)
    return _traced(_fewest(way, curve, ends, tolerance_mm, _longest(way, curve, ends, tolerance_mm)))


def _traced(before: NDArray[np.int64]) -> NDArray[np.int64]:
    found = [len(before) - 1]
    while before[found[-1]] > 0:
        found.append(int(before[found[-1]]))
    return np.array(found[::-1], dtype=np.int64)


@compiled
def _distance_mm(way: NDArray[np.float64], curve: NDArray[np.float64], start: int, end: int) -> float:
    """Return the greatest distance of intermediate places from the straight piece."""
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
    """Return the place before each on the way with the fewest pieces, none shorter than `least`."""
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
