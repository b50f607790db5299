"""Choose the points of a curve that straight pieces join."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers


@compiled
def _distance_mm(way: Floats, curve: Floats, start: int, end: int) -> float:
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
def longest(way: Floats, curve: Floats, may_end: Flags, must_end: Flags, tolerance_mm: float) -> Integers:
    """Return the ends of pieces, each as long as the tolerance allows.

    Args:
        way: of the places that pieces may join, shape (n,).
        curve: the commands there, shape (n, 6) [mm].
        may_end: where pieces may end, shape (n,).
        must_end: where they end in any case, shape (n,); the last place is one.
        tolerance_mm: from a place to the point of its piece at the same share of the way.
    """
    count = len(way)
    ended = np.zeros(count, np.int64)
    start = pieces = 0
    while start < count - 1:
        found = 0
        for end in range(start + 1, count):
            if not (may_end[end] or must_end[end]):
                continue
            if found > 0 and _distance_mm(way, curve, start, end) > tolerance_mm:
                break
            found = end
            if must_end[end]:
                break
        ended[pieces] = found
        pieces += 1
        start = found
    return ended[:pieces]
