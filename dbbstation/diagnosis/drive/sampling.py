"""Resample jittered, rounded or interrupted recordings evenly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from dbbstation.errors import CalibrationError

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.trace.recording import DriveRecording

EVEN = 0.02
"""Negligible deviation of time stamps from even steps, in steps."""

GAP = 3.5
"""Longer steps, in usual steps, are gaps with unknown events."""

FEWEST = 100
"""Fewest gapless samples of a recording."""


@dataclass(frozen=True, eq=False)
class Even:
    """Even signals, shape (n,) each, with notes."""

    t_s: Floats
    position_mm: Floats
    force_n: Floats
    rate_hz: float
    notes: tuple[str, ...]


def evenly_sampled(recording: DriveRecording) -> Even:
    """Return the longest gapless stretch, interpolated if uneven beyond the rounding of times.

    Raises:
        CalibrationError: fewer than a hundred gapless samples.
    """
    notes: list[str] = []
    steps = np.diff(recording.t_s)
    usual = float(np.median(steps)) if len(steps) else 0.0
    edges = np.concatenate([[0], np.flatnonzero(steps > GAP * usual) + 1, [len(recording)]])
    longest = int(np.argmax(np.diff(edges)))
    part = slice(int(edges[longest]), int(edges[longest + 1]))
    t, position, force = recording.t_s[part], recording.position_mm[part], recording.force_n[part]
    if len(t) < FEWEST:
        raise CalibrationError(
            f"{len(t)} samples without a gap are too few, {FEWEST} are needed",
            where=recording.name,
            remedy="record for longer, ten strokes to and fro at several speeds",
        )
    if len(edges) > 2:  # noqa: PLR2004 - only start and end: no gap
        notes.append(
            f"{len(edges) - 2} gaps in the time stamps; the longest stretch without one is used, "
            f"{t[0]:g} to {t[-1]:g} s, {len(t)} of {len(recording)} samples"
        )
    count = np.arange(len(t))
    step, start = np.polyfit(count, t, 1)
    off = float(np.abs(t - (start + step * count)).max())
    if off > max(EVEN * step, 1.01 * _printed_resolution(t)):
        notes.append(
            f"the time stamps are up to {1e3 * off:.3g} ms off even steps of {1e3 * step:.4g} ms; "
            "position and force are interpolated to even steps"
        )
        even = np.linspace(t[0], t[-1], len(t))
        position, force = CubicSpline(t, position)(even), np.interp(even, t, force)
        return Even(even, position, force, float((len(t) - 1) / (t[-1] - t[0])), tuple(notes))
    return Even(start + step * count, position, force, float(1.0 / step), tuple(notes))


def _printed_resolution(t: Floats) -> float:
    """Return the rounding step of times, down to a microsecond [s]; zero if finer."""
    for digits in range(7):
        if np.abs(t - np.round(t, digits)).max() < 1e-3 * 10.0**-digits:
            return float(10.0**-digits)
    return 0.0
