"""A run as it was recorded, before anything is done to it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one run in time order, shapes (n,) unless said otherwise.

    Attributes:
        name: what to call the run in messages, its file where it has one.
        t_s: host time since the first sample, strictly increasing [s].
        length_mm: distance between the ball centres, raw [mm].
        theta_deg: commanded angle from +X towards +Y [deg]; present where the rows are already cut to the
            circle, None where the circle has to be found in the trace.
        temperature_degc: by sensor (`bar`, `jig`, `machine`, `strut1` ... `strut6`) [degC].
        motor_current_a: shape (n, 6), NaN for a motor that was not logged [A]; None where none was.
        usable: False for samples that the instrument itself called bad; they stay in the recording.
    """

    name: str
    t_s: NDArray[np.float64]
    length_mm: NDArray[np.float64]
    theta_deg: NDArray[np.float64] | None = None
    temperature_degc: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    motor_current_a: NDArray[np.float64] | None = None
    usable: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.t_s)
