"""Runs averaged over narrow sectors of the turn: what a diagnosis works on."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.average import averaged, means, sector_of

if TYPE_CHECKING:
    from dbbstation.model.observation import Observation

SECTORS = 720
"""Samples per turn that a diagnosis works on, at the most: every half degree."""

FEWEST_PER_SECTOR = 2
"""Samples per sector below which sectors are made wider."""


def thinned(observation: Observation) -> Observation:
    """Return the run averaged over sectors, with what was commanded averaged alike; as it is where it is short."""
    raw = observation.raw
    if len(raw) <= SECTORS:
        return observation
    sectors = min(SECTORS, max(len(raw) // FEWEST_PER_SECTOR, 1))
    commanded = observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)
