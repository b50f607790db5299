"""The play operator: a follower that a driver pushes from either side of a gap.

    y(t) = max(x - w, min(x + w, y(t-)))

with x the driver, y the follower and w half the gap. Between two turning points of x the formula needs only the
follower's place at the first of them, so the walk goes from turning point to turning point.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray


def follower(driver: FloatArray, half_gap: float, start_offset: float = 0.0) -> FloatArray:
    """Follower `(n,)` of a driver `(n,)`; `start_offset` is follower minus driver before the first sample."""
    steps = np.diff(driver)
    moving = np.flatnonzero(steps)
    turns = moving[1:][np.diff(np.sign(steps[moving])) != 0]
    out = np.empty_like(driver)
    last = float(np.clip(start_offset, -half_gap, half_gap) + driver[0])
    for begin, end in pairwise([0, *turns.tolist(), len(driver) - 1]):
        # On a stretch that runs one way only one of the two bounds can push.
        stretch = driver[begin : end + 1]
        out[begin : end + 1] = np.clip(last, stretch - half_gap, stretch + half_gap)
        last = float(out[end])
    if len(driver) == 1:
        out[0] = last
    return out
