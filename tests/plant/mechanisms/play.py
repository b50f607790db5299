"""Play in a strut: the gap falls open to the side on which the load pulls."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.hexapod import commanded_platform
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.play_operator import follower

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion


@dataclass(frozen=True)
class Play(Mechanism):
    """A gap [µm] per strut. Above the friction [N] the load decides on which side of it the strut hangs.

    Below, friction holds the strut, and the drive crosses the gap first when it turns round, as with backlash.
    """

    name: ClassVar[str] = "play"

    gap_um: tuple[float, float, float, float, float, float] = (5.0, 5.0, 5.0, 5.0, 5.0, 5.0)
    friction_n: float = 100.0

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        """Where in its gap each strut is `(n, 6)`: longer by half of it when pulled, shorter when pushed.

        The load that decides is the one at the commanded pose: at the deflected pose it differs by millinewtons, but a
        strut right at the threshold would then swap sides for ever while the pose is being sought.
        """
        commanded = commanded_platform(platform.machine, motion.commanded)
        commanded.extra_loads = platform.extra_loads
        commanded.inverse_jacobian = platform.inverse_jacobian
        return np.stack([self._strut(motion, commanded.tension_n[:, strut], strut) for strut in range(6)], axis=1)

    def _strut(self, motion: Motion, tension_n: FloatArray, strut: int) -> FloatArray:
        half_mm = self.gap_um[strut] / 2000.0
        side = np.where(np.abs(tension_n) > self.friction_n, np.sign(tension_n), 0.0)
        place_mm = half_mm * side
        changes = np.flatnonzero(np.diff(side)) + 1
        for begin, end in pairwise([0, *changes.tolist(), len(side)]):
            if side[begin] == 0.0:
                before_mm = place_mm[begin - 1] if begin else 0.0
                # The drive moved on between the last loaded sample and the first free one.
                driver_mm = motion.commanded_mm[max(begin - 1, 0) : end, strut]
                followed_mm = follower(driver_mm, half_mm, before_mm) - driver_mm
                place_mm[begin:end] = followed_mm[-(end - begin) :]
        return place_mm
