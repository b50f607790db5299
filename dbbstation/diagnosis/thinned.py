"""Average runs over narrow sectors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.trace.recording import averaged, means, sector_of

if TYPE_CHECKING:
    from dbbstation.model.observation import Observation


MOST_SAMPLES = 30 * BOUNDS.samples_per_turn
"""Most samples of all runs in a diagnosis, as for thirty circles. Columns of all causes then take 0.9 GB, most of its memory."""

LEAST_SECTORS = BOUNDS.samples_per_turn // 2
"""Least samples per turn for any number of runs; with fewer, noise cannot be estimated far above the low harmonics."""


FINER = 4
"""Most samples per sector at which sharp effects are evaluated: a step's share of a sector is known to an eighth."""


def sectors_for(runs: int) -> int:
    """Return the number of samples per turn for a number of runs."""
    return max(min(BOUNDS.samples_per_turn, MOST_SAMPLES // max(runs, 1)), LEAST_SECTORS)


def thinned(observation: Observation, most: int = BOUNDS.samples_per_turn) -> Observation:
    """Return the run averaged over sectors, with its commands; short runs are unchanged."""
    raw = observation.raw
    if len(raw) <= most:
        return observation
    sectors = min(most, max(len(raw) // BOUNDS.samples_per_sector, 1))
    finer = _averaged(observation, FINER * sectors) if len(raw) > FINER * sectors else observation
    return replace(_averaged(finer, sectors), finer=(finer, sector_of(finer.raw, sectors)))


def _averaged(observation: Observation, sectors: int) -> Observation:
    raw, commanded = observation.raw, observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)
