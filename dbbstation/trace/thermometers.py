"""What thermometers logged in the runs of a session, as curves over its time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import lsq_linear

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def logged_curve(
    runs: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Temperature over a session: two points for each run, the smoothest curve that shows what was logged.

    A thermometer that shows tenths says no more than that it is within half a tenth: of all curves within that of the
    means of each half run the one of least bending is taken. One of fine steps is followed as it is.

    Args:
        runs: times [s] and temperatures [degC] of each run, in order of time, shape (n,) each.

    Returns:
        Times [s] and temperatures [degC], shape (2 r,) each.
    """
    halves = [half for run in runs for half in zip(*(np.array_split(one, 2) for one in run), strict=True)]
    halves = [(time_s, degc) for time_s, degc in halves if len(time_s)]
    time_s = np.array([one.mean() for one, _ in halves])
    shown = np.array([one.mean() for _, one in halves])
    half_step = 0.5 * _resolution(np.concatenate([degc for _, degc in runs]))
    gaps = np.diff(time_s)
    if len(time_s) < _BENDS or half_step < _ROUNDING or np.any(gaps <= 0.0):
        return time_s, shown
    slope = np.diff(np.eye(len(time_s)), axis=0) / gaps[:, None]
    bending = np.diff(slope, axis=0) / np.sqrt(0.5 * (gaps[1:] + gaps[:-1]))[:, None]
    # In units of half a step about what was shown, so that bounds are plus and minus one.
    found = lsq_linear(bending * half_step, -bending @ shown, bounds=(-1.0, 1.0))
    return time_s, shown + half_step * np.asarray(found.x, dtype=np.float64)


_BENDS = 3
"""Points of the shortest curve that can be bent."""

_ROUNDING = 1e-9
"""Half a step below which nothing was rounded [K]."""


def _resolution(degc: NDArray[np.float64]) -> float:
    """Smallest step between values that were shown [K]; zero where there was one only."""
    steps = np.diff(np.unique(degc))
    return float(steps.min(initial=np.inf)) if len(steps) else 0.0
