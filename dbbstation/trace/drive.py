"""A recording of one drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats


@dataclass(frozen=True, eq=False)
class DriveRecording:
    """Samples of one drive, in time order.

    Attributes:
        position_mm: along the axis, shape (n,).
        force_n: driving, positive towards greater positions, shape (n,).
    """

    name: str
    t_s: Floats
    position_mm: Floats
    force_n: Floats

    def __len__(self) -> int:
        return len(self.t_s)
