"""A run as it was recorded, before anything is done to it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.trace.columns import WithLogged

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class Recording(WithLogged):
    """Samples of one run in time order, shapes (n,) unless said otherwise.

    Attributes:
        name: what to call the run in messages, its file where it has one.
        t_s: host time since the first sample, strictly increasing [s].
        length_mm: distance between the ball centres, raw [mm].
        theta_deg: commanded angle from +X towards +Y [deg]; present where the rows are already cut to the
            circle, None where the circle has to be found in the trace.
        logged: what was logged beside the bar, by the name of its column.
        usable: False for samples that the instrument itself called bad; they stay in the recording.
    """

    name: str
    t_s: NDArray[np.float64]
    length_mm: NDArray[np.float64]
    theta_deg: NDArray[np.float64] | None = None
    logged: Logged = field(default_factory=dict)
    usable: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.t_s)
