"""Directions and turning points of a drive; a turn is a retreat beyond noise, resolution and jitter.

Turning points are extremes with a minimum return [rainflow counting with a hysteresis gate: ASTM E1049-85, sec. 5.4.4;
Amzallag et al., Int. J. Fatigue 16 (1994) 287, sec. 3.1].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers

RETREAT_SIGMA = 5.0
"""Least retreat in standard deviations of position: noise reaches it once in ten thousand samples at standstill."""

WHOLE = 0.02
"""Largest distance of rounded positions from whole steps, in steps; files round positions again."""


def retreat_m(noise_m: float, resolution_m: float) -> float:
    """Return the retreat that counts as a turn [m].

    Args:
        noise_m: of position, including jitter at speed.
        resolution_m: rounding step, zero if unknown; steps above the travel per sample are not white noise.
    """
    return RETREAT_SIGMA * noise_m + 1.5 * resolution_m


def resolution_of(position: Floats) -> float:
    """Return the position's rounding step, zero if none."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 0.0]
    if not len(steps):
        return 0.0
    least = float(np.quantile(steps, 0.001, method="lower"))
    count = np.round(steps / least)
    # Large and small steps are equally exact, so the resolution follows from all of them.
    size = float(count @ steps / (count @ count))
    return size if float(np.median(np.abs(steps / size - np.round(steps / size)))) < WHOLE else 0.0


def turning_points(position_m: Floats, retreat: float) -> Integers:
    """Return the turning samples, ascending, shape (t,)."""
    found: list[int] = []
    way = 0
    highest = lowest = 0
    values = position_m.tolist()
    for k, value in enumerate(values):
        if value > values[highest]:
            highest = k
        if value < values[lowest]:
            lowest = k
        if way >= 0 and values[highest] - value > retreat:
            if way > 0:
                found.append(highest)
            way, lowest = -1, k
        elif way <= 0 and value - values[lowest] > retreat:
            if way < 0:
                found.append(lowest)
            way, highest = 1, k
    return np.array(found, dtype=np.int64)


def ways(position_m: Floats, turns: Integers) -> Floats:
    """Return directions of travel, +1 or -1, shape (n,); zero without motion."""
    ends = np.concatenate([[0], turns, [len(position_m) - 1]])
    signs = np.sign(np.diff(position_m[ends]))
    return np.repeat(signs, np.diff(np.concatenate([[0], turns, [len(position_m)]])))
