"""What happens where a strut turns round, in other forms than a gap with hard edges: soft edges, and sticking in jerks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.hexapod import commanded_platform
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.play import Play

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion


@dataclass(frozen=True)
class SoftBacklash(Backlash):
    """A gap without edges: a strut that turns round comes to its other side exponentially, over `settle_um` of travel.

    Dahl's friction [J. Dynamic Systems 98 (1976) 1]: `dz/dx = (sign(dx) - z)/settle`, solved exactly from sample to sample.
    """

    settle_um: Six = (20.0, 20.0, 20.0, 20.0, 20.0, 20.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        """Minus half the gap long after a strut began to grow, plus half of it after it began to shrink `(n, 6)`."""
        del motion
        steps_mm = np.diff(driven_mm, axis=0, prepend=driven_mm[:1])
        kept = np.exp(-np.abs(steps_mm) / (np.array(self.settle_um) / 1000.0))
        side = np.zeros(driven_mm.shape)
        for k in range(1, len(side)):
            side[k] = np.sign(steps_mm[k]) + (side[k - 1] - np.sign(steps_mm[k])) * kept[k]
        return -np.array(self.gap_um) / 2000.0 * side


@dataclass(frozen=True)
class SoftPlay(Play):
    """A gap filled with grease or a soft seat: the load moves the strut across it little by little, `tanh(T/friction)`."""

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        commanded = commanded_platform(platform.machine, motion.commanded)
        commanded.extra_loads = platform.extra_loads
        commanded.inverse_jacobian = platform.inverse_jacobian
        return np.array(self.gap_um) / 2000.0 * np.tanh(commanded.tension_n / self.friction_n)


@dataclass(frozen=True)
class StickSlip(Mechanism):
    """A strut that turned round sticks and slips: it stays behind over `stick_um` of travel, jumps, and sticks again.

    After `jerks` of them, each as long as the one before, it slides.
    """

    name: ClassVar[str] = "stick-slip"
    listed: ClassVar[bool] = False

    stick_um: Six = (4.0, 4.0, 4.0, 4.0, 4.0, 4.0)
    jerks: int = 4

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        return np.stack([self._strut(driven_mm[:, k], um / 1000.0) for k, um in enumerate(self.stick_um)], axis=1)

    def _strut(self, driven_mm: FloatArray, stick_mm: float) -> FloatArray:
        steps_mm = np.diff(driven_mm, prepend=driven_mm[:1])
        moving = np.flatnonzero(steps_mm)
        turns = moving[1:][np.diff(np.sign(steps_mm[moving])) != 0]
        late_mm = np.zeros(len(driven_mm))
        if stick_mm > 0.0:
            for begin, end in zip(turns, [*turns[1:], len(driven_mm)], strict=True):
                travel_mm = np.abs(driven_mm[begin:end] - driven_mm[begin - 1])
                tooth_mm = np.where(travel_mm < self.jerks * stick_mm, travel_mm % stick_mm, 0.0)
                late_mm[begin:end] = -np.sign(steps_mm[begin]) * tooth_mm
        return late_mm
