"""Where in time and on the travel a misfit stands out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.findings import DriveLocation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.design import Design

MOST_LOCATIONS = 12
COUNTS_SIGMA = 4.0
"""A smoothed deviation counts as misfit above this many of its standard deviations."""

SMOOTHED = 5
"""Samples that are averaged before they are looked at; so many below the limit do not end a stretch."""

SLOW = 0.1
"""Share of the greatest speed below which a stretch lies at a reversal or stop."""


def locate(design: Design, residual_n: NDArray[np.float64]) -> tuple[DriveLocation, ...]:
    """Stretches in which a residual, shape (m,) [N], stands out of the noise, largest share first."""
    signals = design.signals
    at = signals.kept
    smooth = np.convolve(residual_n, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="same")
    together = min(design.noise.correlation_samples, float(SMOOTHED))
    threshold = COUNTS_SIGMA * design.noise.sigma * np.sqrt(together / SMOOTHED)
    total = float(smooth @ smooth)
    found: list[DriveLocation] = []
    for rows in _stretches(np.abs(smooth) > threshold, signals.direction[at]):
        slowest = float(np.abs(signals.speed_m_s[at[rows[0]] : at[rows[-1]] + 1]).min())
        found.append(
            DriveLocation(
                t_s=(float(signals.t_s[at[rows[0]]]), float(signals.t_s[at[rows[-1]]])),
                position_mm=(
                    1e3 * float(signals.position_m[at[rows[0]]]),
                    1e3 * float(signals.position_m[at[rows[-1]]]),
                ),
                direction=int(signals.direction[at[rows[0]]]),
                at_reversal=slowest < SLOW * signals.scale.speed_m_s,
                share=float(smooth[rows] @ smooth[rows]) / total,
                peak_n=float(smooth[rows][np.argmax(np.abs(smooth[rows]))]),
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
