"""Where the fixed ball really is: scatter of each mounting, errors of the CMM sheet, and a ball that is badly seated."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism
from tests.plant.plan import HOLDER_REPEATABILITY_UM

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion, Scene


@dataclass(frozen=True)
class MountingShifts(Mechanism):
    """Shift [µm] `(3,)` of the ball, jig frame, for each mounting of the session by its number."""

    name: ClassVar[str] = "mounting"

    shift_um: Mapping[int, FloatArray] = field(default_factory=dict)

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        del platform
        shift_um = self.shift_um.get(motion.of_run.mounting)
        return None if shift_um is None else motion.scene.plan.jig_rotation @ shift_um / 1000.0


@dataclass(frozen=True)
class MountingScatter(Mechanism):
    """Every mounting shifts the ball at random, by the repeatability of its holder [CAL III-B] times `factor`."""

    name: ClassVar[str] = "mounting"

    factor: float = 1.0

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        holders = {slot.mounting: scene.plan.ball(slot.test.ball).holder for slot in scene.slots}
        return MountingShifts(
            {
                mounting: self.factor * HOLDER_REPEATABILITY_UM[holder] * rng.standard_normal(3)
                for mounting, holder in holders.items()
            }
        )


@dataclass(frozen=True)
class BadSeating(MountingShifts):
    """A ball badly put up: a shift far outside the usual scatter, at a few mountings only."""

    name: ClassVar[str] = "bad-seating"


@dataclass(frozen=True)
class BallCoordinates(Mechanism):
    """Error [µm] `(3,)` of a ball's entry in the CMM sheet, jig frame: true minus printed, for all its mountings."""

    name: ClassVar[str] = "ball-coordinate"

    error_um: Mapping[str, FloatArray] = field(default_factory=dict)

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        del platform
        error_um = self.error_um.get(motion.of_run.test.ball)
        return None if error_um is None else motion.scene.plan.jig_rotation @ np.asarray(error_um) / 1000.0


@dataclass(frozen=True)
class CmmScatter(Mechanism):
    """Every entry of the CMM sheet is off at random, by its stated uncertainty times `factor`."""

    name: ClassVar[str] = "ball-coordinate"

    factor: float = 1.0

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        return BallCoordinates(
            {ball.name: self.factor * ball.uncertainty_um * rng.standard_normal(3) for ball in scene.plan.balls}
        )
