"""Circles cut out of recordings: raw ones, which calibrate a machine, and centred ones, which cannot."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.columns import WithLogged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class RawCircle(WithLogged):
    """One full turn of raw bar lengths in time order, no centre removed, shapes (n,) unless said otherwise.

    Attributes:
        name: what to call the run in messages.
        t_s: time since the recording's first sample [s].
        phi_deg: progress along the turn, 0 up to 360 [deg].
        logged: what was logged beside the bar, by the name of its column.
        start_uncertainty_deg: how well the beginning of the turn is known, one standard deviation; zero where angles were
            recorded [deg].
    """

    name: str
    circle: Circle
    t_s: NDArray[np.float64]
    phi_deg: NDArray[np.float64]
    length_mm: NDArray[np.float64]
    logged: Logged = field(default_factory=dict)
    start_uncertainty_deg: float = 0.0

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def theta_deg(self) -> NDArray[np.float64]:
        """Angle from +X towards +Y, within 0 to 360 [deg]."""
        return np.mod(self.circle.theta_deg(self.phi_deg), 360.0)


@dataclass(frozen=True, eq=False)
class CentredCircle:
    """A circle after centre compensation [CAL eq 6]: its position on the machine is gone and cannot come back.

    Attributes:
        theta_deg: angle from +X towards +Y, shape (n,) [deg].
        deviation_mm: radial deviation from the best-fit circle, shape (n,) [mm].
    """

    name: str
    circle: Circle
    theta_deg: NDArray[np.float64]
    deviation_mm: NDArray[np.float64]
    radius_mm: float
