"""Runs averaged over narrow sectors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.trace.average import averaged, means, sector_of

if TYPE_CHECKING:
    from dbbstation.model.observation import Observation


MOST_SAMPLES = 30 * BOUNDS.samples_per_turn
"""Samples of all runs that a diagnosis works on: those of thirty circles. Columns of all causes over them take most of its memory, 0.9 GB."""

LEAST_SECTORS = BOUNDS.samples_per_turn // 2
"""Samples per turn that are kept however many runs there are: with fewer, noise is not read from harmonics far above the low ones."""


def sectors_for(runs: int) -> int:
    """Return samples per turn for so many runs."""
    return max(min(BOUNDS.samples_per_turn, MOST_SAMPLES // max(runs, 1)), LEAST_SECTORS)


def thinned(observation: Observation, most: int = BOUNDS.samples_per_turn) -> Observation:
    """Return the run averaged over sectors, with its command; short runs as they are."""
    raw = observation.raw
    if len(raw) <= most:
        return observation
    sectors = min(most, max(len(raw) // BOUNDS.samples_per_sector, 1))
    commanded = observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)
