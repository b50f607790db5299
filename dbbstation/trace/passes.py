"""Differences between both passes of the overlap, one turn apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.cut import edges_of, progress_deg

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.circle import Circle
    from dbbstation.trace.recording import Recording

MARGIN_DEG = 5.0
"""Ignored arc after the feed-in and before the feed-out [deg]. The machine accelerates there, and corner dwells of 0.3
s make the overlap's start uncertain by 2 degrees at the usual feed."""

FEWEST_SAMPLES = 20
"""Fewest samples of a usable overlap."""


@dataclass(frozen=True, eq=False)
class Passes:
    """Readings of the second pass less the first."""

    phi_deg: Floats
    apart_um: Floats
    turn_s: float

    @property
    def mean_um(self) -> float:
        """Return the reading's growth after one turn [µm]."""
        return float(self.apart_um.mean())

    def u_mean_um(self, sigma_um: float) -> float:
        """Return the standard uncertainty of `mean_um` for noise `sigma_um` per sample [µm]."""
        return sigma_um * float(np.sqrt(2.0 / len(self.apart_um)))


def passes_of(recording: Recording, circle: Circle) -> Passes | None:
    """Return the difference of both passes; None for a recording already cut or too short an overlap.

    Raises:
        TraceError: feed-in or feed-out is missing.
    """
    if recording.theta_deg is not None or circle.overshoot_deg <= MARGIN_DEG:
        return None
    phi = progress_deg(recording, circle, edges_of(recording, circle))
    usable = np.ones(len(phi), dtype=bool) if recording.usable is None else recording.usable
    reach = circle.overshoot_deg - MARGIN_DEG
    first = usable & (np.abs(phi) <= reach)
    second = usable & (np.abs(phi - FULL_TURN_DEG) <= reach + MARGIN_DEG)
    if min(np.count_nonzero(first), np.count_nonzero(second)) < FEWEST_SAMPLES:
        return None
    again = np.interp(phi[first] + FULL_TURN_DEG, phi[second], recording.length_mm[second])
    return Passes(phi[first], 1e3 * (again - recording.length_mm[first]), FULL_TURN_DEG / circle.turning_deg_s)
