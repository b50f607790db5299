"""Temperature curves over a session."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats


def logged_curve(
    runs: Sequence[tuple[Floats, Floats]],
) -> tuple[Floats, Floats]:
    """Return a session's temperature curve: rising times [s] and temperatures [degC], two points per run, shape (q,) each.

    Among all curves within half a display step of each half run's mean, the least bent is chosen. Changes within half a
    run are lost.
    """
    halves = [half for run in runs for half in zip(*(np.array_split(one, 2) for one in run), strict=True)]
    means = {float(one.mean()): float(degc.mean()) for one, degc in halves if len(one)}
    # Runs whose clock was set back in between overlap.
    time_s = np.array(sorted(means))
    shown = np.array([means[moment] for moment in time_s])
    half_step = 0.5 * _resolution(np.concatenate([degc for _, degc in runs]))
    gaps = np.diff(time_s)
    if len(time_s) < _BENDS or half_step < SHOWN_K:
        return time_s, shown
    slope = np.diff(np.eye(len(time_s)), axis=0) / gaps[:, None]
    bending = np.diff(slope, axis=0) / np.sqrt(0.5 * (gaps[1:] + gaps[:-1]))[:, None]
    # In units of half a display step about the displayed value, so bounds are plus and minus one.
    from scipy.optimize import lsq_linear  # noqa: PLC0415 - takes a fifth of a second; few sessions need it

    found = lsq_linear(bending * half_step, -bending @ shown, bounds=(-1.0, 1.0))
    return time_s, shown + half_step * np.asarray(found.x, dtype=np.float64)


_BENDS = 3
"""Fewest points of a curve that can be bent."""

SHOWN_K = 1e-3
"""Finest display step of a thermometer, as in recordings [K]."""


def _resolution(degc: Floats) -> float:
    """Return the greatest common divisor of displayed differences [K]; zero for one value."""
    steps = np.diff(np.unique(np.round(degc / SHOWN_K).astype(np.int64)))
    return SHOWN_K * float(np.gcd.reduce(steps)) if len(steps) else 0.0
