"""Both passes of the overlap: the same places, one turn apart."""

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
"""Stretch behind the feed-in and before the feed-out that does not count: the machine gathers speed there, and where the
overlap begins is known to the dwell at the corners, 0.3 s, which is 2 degrees at the usual feed [deg]."""

FEWEST_SAMPLES = 20
"""Samples of the overlap below which it says nothing."""


@dataclass(frozen=True, eq=False)
class Passes:
    """Second pass less first."""

    phi_deg: Floats
    apart_um: Floats
    turn_s: float

    @property
    def mean_um(self) -> float:
        """Return the reading's growth after one turn [µm]."""
        return float(self.apart_um.mean())

    def u_mean_um(self, sigma_um: float) -> float:
        """Return its standard uncertainty for noise `sigma_um` per sample [µm]."""
        return sigma_um * float(np.sqrt(2.0 / len(self.apart_um)))


def passes_of(recording: Recording, circle: Circle) -> Passes | None:
    """Return both passes of the overlap; None if cut or too short.

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
