"""A raw recording of one drive: position and force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class DriveRecording:
    """Samples of one drive, in time order.

    Attributes:
        position_mm: along the axis, shape (n,).
        force_n: driving, positive towards greater positions, shape (n,).
    """

    name: str
    t_s: NDArray[np.float64]
    position_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.t_s)
