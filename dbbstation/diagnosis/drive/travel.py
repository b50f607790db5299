"""Which way a drive travels: it turns where its position retreats beyond what noise, resolution and stamps make of it.

The sign of a speed that is read from noisy positions changes without any turn. Turning points of a position are those of its
zigzag: extremes from which it comes back by more than a given way [rainflow counting with a hysteresis gate: ASTM E1049-85,
sec. 5.4.4; Amzallag et al., Int. J. Fatigue 16 (1994) 287, sec. 3.1].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

RETREAT_SIGMA = 5.0
"""Standard deviations of the position by which it must retreat: noise does so once in ten thousand samples of a standing drive."""

WHOLE = 0.02
"""Share of a step by which positions may be off whole steps to have been rounded to it: digits of a file round them again."""


def retreat_m(noise_m: float, resolution_m: float) -> float:
    """Way back beyond which a drive has turned [m].

    Args:
        noise_m: standard deviation of the measured position; what jitter of the stamps makes of it at speed is part of it [m].
        resolution_m: step that positions were rounded to, zero if unknown [m]; slower than a step per sample, rounding is no white
            noise and does not show in a spectrum.
    """
    return RETREAT_SIGMA * noise_m + 1.5 * resolution_m


def resolution_of(position: NDArray[np.float64]) -> float:
    """Step that positions were rounded to, in their unit; zero where they are not whole steps of anything.

    Args:
        position: as measured, shape (n,).
    """
    steps = np.abs(np.diff(position))
    steps = steps[steps > 0.0]
    if not len(steps):
        return 0.0
    least = float(np.quantile(steps, 0.001, method="lower"))
    count = np.round(steps / least)
    # A step of many resolutions is known as well as one: take the least one from all of them.
    size = float(count @ steps / (count @ count))
    return size if float(np.median(np.abs(steps / size - np.round(steps / size)))) < WHOLE else 0.0


def turning_points(position_m: NDArray[np.float64], retreat: float) -> NDArray[np.int64]:
    """Samples at which a position turns, rising, shape (t,).

    Args:
        position_m: shape (n,) [m].
        retreat: way from an extreme back beyond which it has turned [m].
    """
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


def ways(position_m: NDArray[np.float64], turns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Direction of travel of every sample, +1 or -1, shape (n,); zero where the position does not change at all.

    Args:
        position_m: shape (n,) [m].
    """
    ends = np.concatenate([[0], turns, [len(position_m) - 1]])
    signs = np.sign(np.diff(position_m[ends]))
    return np.repeat(signs, np.diff(np.concatenate([[0], turns, [len(position_m)]])))
