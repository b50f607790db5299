"""Average runs over narrow sectors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.trace.circle import averaged, means, sector_of

if TYPE_CHECKING:
    from dbbstation.model.observation import Observation


MOST_SAMPLES = 30 * BOUNDS.samples_per_turn
"""Most samples of all runs in a diagnosis, as for thirty circles. Columns of all causes then take 0.9 GB, most of its memory."""

LEAST_SECTORS = BOUNDS.samples_per_turn // 2
"""Least samples per turn for any number of runs; with fewer, noise cannot be estimated far above the low harmonics."""


def sectors_for(runs: int) -> int:
    """Return the number of samples per turn for a number of runs."""
    return max(min(BOUNDS.samples_per_turn, MOST_SAMPLES // max(runs, 1)), LEAST_SECTORS)


def thinned(observation: Observation, most: int = BOUNDS.samples_per_turn) -> Observation:
    """Return the run averaged over sectors, with its commands; short runs are unchanged."""
    raw = observation.raw
    if len(raw) <= most:
        return observation
    sectors = min(most, max(len(raw) // BOUNDS.samples_per_sector, 1))
    commanded = observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)
