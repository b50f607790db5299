"""Where in time and on the travel a misfit stands out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.findings import DriveLocation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.inference.coloured import Coloured

MOST_LOCATIONS = 12
COUNTS_SIGMA = 4.0
"""A smoothed deviation counts as misfit above this many of its standard deviations."""

SMOOTHED = 5
"""Samples that are averaged before they are looked at; so many below the limit do not end a stretch."""

SLOW = 0.1
"""Share of the greatest speed below which a stretch lies at a reversal or stop."""


def locate(recordings: Recordings, residual_n: NDArray[np.float64], noise: Coloured) -> tuple[DriveLocation, ...]:
    """Stretches in which a residual, shape (m,) [N], exceeds the noise, largest share first."""
    smooth = np.convolve(residual_n, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="same")
    together = min(noise.correlation_samples, float(SMOOTHED))
    threshold = COUNTS_SIGMA * noise.sigma * np.sqrt(together / SMOOTHED)
    total = max(float(smooth @ smooth), 1e-300)
    found: list[DriveLocation] = []
    for signals, block in zip(recordings.signals, recordings.blocks, strict=True):
        own, at = smooth[block], signals.kept
        standing = SLOW * float(np.abs(signals.speed_m_s[at]).max())
        for rows in _stretches(np.abs(own) > threshold, signals.direction[at]):
            first, last = int(at[rows[0]]), int(at[rows[-1]])
            found.append(
                DriveLocation(
                    t_s=(float(signals.t_s[first]), float(signals.t_s[last])),
                    position_mm=(1e3 * float(signals.position_m[first]), 1e3 * float(signals.position_m[last])),
                    direction=int(signals.direction[first]),
                    at_reversal=float(np.abs(signals.speed_m_s[first : last + 1]).min()) < standing,
                    share=float(own[rows] @ own[rows]) / total,
                    peak_n=float(own[rows][np.argmax(np.abs(own[rows]))]),
                )
            )
    found.sort(key=lambda location: -location.share)
    return tuple(found[:MOST_LOCATIONS])


def _stretches(marked: NDArray[np.bool_], direction: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Marked samples that stand together, short breaks bridged, parted where the direction changes."""
    rows = np.flatnonzero(marked)
    if not len(rows):
        return []
    parted = (np.diff(rows) > SMOOTHED) | (np.diff(direction[rows]) != 0.0)
    return [np.arange(part[0], part[-1] + 1) for part in np.split(rows, np.flatnonzero(parted) + 1)]
