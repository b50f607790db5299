"""Repeated readings: a gauge asked too often, or rows written twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import bdtrik

from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.held import SHORTEST_S, chance_equal, moving_noise
from dbbstation.quality.limits import SHARE

if TYPE_CHECKING:
    from dbbstation.trace.circle import RawCircle

HARMLESS = 0.19
"""Share of readings that may be repeated without harm: of n readings 0.81 n are new, and U of slow figures is too small by a tenth, as
1 / sqrt(0.81); U is stated to two digits."""


def repeated(raw: RawCircle) -> Finding:
    """Judge how many readings repeat the last, apart from long standstills."""
    ends = np.flatnonzero(np.diff(raw.length_mm) != 0.0)
    if not len(ends):
        return undecided(
            Name.REPEATED, "all readings of the turn are the same: the step is not finer than the noise", "%"
        )
    first, last = np.append(0, ends + 1), np.append(ends, len(raw) - 1)
    short = raw.t_s[last] - raw.t_s[first] < SHORTEST_S
    squares_mm2, count, step_mm = moving_noise(raw)
    chance = chance_equal(squares_mm2, count, step_mm)
    share = float(np.sum((last - first)[short])) / max(count, 1)
    if chance >= 1.0:
        why = f"{100.0 * share:.0f} % of the readings are the same as the one before; their step is not finer than their noise"
        return undecided(Name.REPEATED, why, "%", 100.0 * share)
    limit = max(HARMLESS, float(bdtrik(1.0 - SHARE, count, chance)) / count)
    stated = f"{100.0 * share:.0f} % of the readings are the same as the one before"
    return found(
        Name.REPEATED,
        100.0 * share,
        100.0 * limit,
        "%",
        stated,
        f"{stated}: the gauge is asked more often than it has new readings, or rows come twice; set the rate to what it renews, and "
        "repeat the run",
        f"{100.0 * share:.0f} % of the readings come more than once",
    )
