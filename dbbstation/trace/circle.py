"""Circles cut from recordings: raw circles can calibrate a machine, centred circles cannot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.columns import WithLogged

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.circle import Circle
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class RawCircle(WithLogged):
    """One full turn of raw lengths in time order, shapes (n,).

    Attributes:
        t_s: since the recording's first sample.
        phi_deg: along the turn, 0 to 360.
        start_uncertainty_deg: standard uncertainty of the turn's start; zero with recorded angles.
    """

    name: str
    circle: Circle
    t_s: Floats
    phi_deg: Floats
    length_mm: Floats
    logged: Logged = field(default_factory=dict)
    start_uncertainty_deg: float = 0.0

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def theta_deg(self) -> Floats:
        """Return the angle from +X towards +Y, within 0 to 360 [deg]."""
        return np.mod(self.circle.theta_deg(self.phi_deg), 360.0)


@dataclass(frozen=True, eq=False)
class CentredCircle:
    """A circle after removal of its centre [CAL eq 6].

    Attributes:
        theta_deg: from +X towards +Y, shape (n,).
        deviation_mm: from the best-fit circle, shape (n,).
    """

    name: str
    circle: Circle
    theta_deg: Floats
    deviation_mm: Floats
    radius_mm: float
