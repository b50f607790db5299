"""Locate a misfit in time and travel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.findings import ForceLocation
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.left_over import COUNTS_SIGMA

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.inference.coloured import Coloured


SMOOTHED = 5
"""Samples averaged before the test; so many below the limit do not end a stretch."""

SLOW = 0.1
"""Share of the greatest speed below which a stretch counts as reversal or stop."""


def locate(
    recordings: Recordings, residual_n: Floats, noise: Coloured, variable: str | None
) -> tuple[ForceLocation, ...]:
    """Return stretches of a residual, shape (m,) [N], beyond noise, largest share first, and their variable."""
    smooth = np.convolve(residual_n, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="same")
    together = min(noise.correlation_samples, float(SMOOTHED))
    threshold = COUNTS_SIGMA * noise.sigma * np.sqrt(together / SMOOTHED)
    total = max(float(smooth @ smooth), 1e-300)
    found: list[ForceLocation] = []
    for signals, block in zip(recordings.signals, recordings.blocks, strict=True):
        own, at = smooth[block], signals.kept
        standing = SLOW * float(np.abs(signals.speed_m_s[at]).max())
        for rows in _stretches(np.abs(own) > threshold, signals.direction[at]):
            first, last = int(at[rows[0]]), int(at[rows[-1]])
            t_s = float(signals.t_s[first]), float(signals.t_s[last])
            mm = 1e3 * float(signals.position_m[first]), 1e3 * float(signals.position_m[last])
            way = "forwards" if signals.direction[first] > 0 else "backwards"
            turns = float(np.abs(signals.speed_m_s[first : last + 1]).min()) < standing
            peak = float(own[rows][np.argmax(np.abs(own[rows]))])
            text = (
                f"{t_s[0]:.2f} to {t_s[1]:.2f} s, {mm[0]:.1f} to {mm[1]:.1f} mm {way}"
                f"{', at a reversal or stop' if turns else ''}: up to {peak:+.3g} N{f', by {variable}' if variable else ''}"
            )
            share = float(own[rows] @ own[rows]) / total
            found.append(ForceLocation(t_s, mm, way, turns, variable or None, share, peak, text))
    found.sort(key=lambda location: -location.share)
    return tuple(found[: BOUNDS.locations])


def _stretches(marked: Flags, direction: Floats) -> list[Integers]:
    rows = np.flatnonzero(marked)
    if not len(rows):
        return []
    parted = (np.diff(rows) > SMOOTHED) | (np.diff(direction[rows]) != 0.0)
    return [np.arange(part[0], part[-1] + 1) for part in np.split(rows, np.flatnonzero(parted) + 1)]
