"""Backlash of a strut drive: play, or friction that winds the strut up, opens when the strut turns round."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.play_operator import follower

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.run import Motion


@dataclass(frozen=True)
class Backlash(Mechanism):
    """The strut follows its drive through a gap [µm] per strut; at the start of a run it hangs in the middle of it.

    A strut that grows ends up half a gap too short, one that shrinks half a gap too long. The path before the circle
    counts: a strut that turns only late on the overshoot arc enters the data somewhere inside the gap.
    """

    name: ClassVar[str] = "backlash"

    gap_um: tuple[float, float, float, float, float, float] = (4.0, 4.0, 4.0, 4.0, 4.0, 4.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        followed_mm = [follower(driven_mm[:, strut], gap_um / 2000.0) for strut, gap_um in enumerate(self.gap_um)]
        return np.stack(followed_mm, axis=1) - driven_mm
