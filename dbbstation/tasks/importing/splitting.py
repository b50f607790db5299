"""Separate several runs in one file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.cut import LARGEST_GAP_DEG

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.plan.circle import Circle

SMALLEST_RUN_DEG = 90.0
"""Smallest reversal of the angles that begins a new run [deg]; smaller ones come from settling axes, overshoot or
noise."""


def longest_pause_s(circles: Sequence[Circle]) -> float:
    """Return the longest pause within a run [s]."""
    return max(LARGEST_GAP_DEG / circle.turning_deg_s for circle in circles)


def parts_by_gaps(t_s: Floats | None, lines: Integers, pause_s: float) -> list[Integers]:
    """Return the rows of each run, separated by pauses, restarted times or empty lines.

    Args:
        t_s: shape (n,); None if the file has none.
    """
    begins = np.diff(lines) > 1
    if t_s is not None:
        steps = np.diff(t_s)
        begins |= (steps > pause_s) | (steps < 0.0)
    return _parts(len(lines), np.flatnonzero(begins) + 1)


def parts_by_direction(angle_deg: Floats) -> list[Integers]:
    """Return the rows of each run, separated by a change of turning direction."""
    travelled = np.unwrap(angle_deg, period=FULL_TURN_DEG)
    ends: list[int] = []
    low = high = 0
    sense = 0
    for k, value in enumerate(travelled.tolist()):
        high = k if value > travelled[high] else high
        low = k if value < travelled[low] else low
        if sense >= 0 and value <= travelled[high] - SMALLEST_RUN_DEG:
            if sense > 0:
                ends.append(high)
            sense, low = -1, k
        elif sense <= 0 and value >= travelled[low] + SMALLEST_RUN_DEG:
            if sense < 0:
                ends.append(low)
            sense, high = 1, k
        if sense > 0:
            low = k
        elif sense < 0:
            high = k
    return _parts(len(travelled), np.array(ends, dtype=np.int64) + 1)


def _parts(n: int, begins: Integers) -> list[Integers]:
    return [rows for rows in np.split(np.arange(n), begins) if len(rows)]
