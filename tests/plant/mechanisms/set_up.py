"""What is wrong with the set-up of a session besides the usual scatter: tool ball, jig plate, form of balls and scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion


@dataclass(frozen=True)
class ToolBallOffset(Mechanism):
    """The moving ball is not at the tool tip: offset in the platform frame [mm]."""

    name: ClassVar[str] = "tool-ball-offset"

    offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def tool_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion, platform
        return np.array(self.offset_mm)


@dataclass(frozen=True)
class JigDistortion(Mechanism):
    """The plate was clamped on something: it bows along one direction, and the holders lean with its slope.

    Height `bow ((s/reach)² - 1)` with s the distance from the middle along the bow, so it is nothing at `reach_mm`.
    """

    name: ClassVar[str] = "jig-distortion"

    bow_um: float = 10.0
    along_deg: float = 30.0
    reach_mm: float = 141.4

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        plan = motion.scene.plan
        centre_mm = np.array(plan.ball(motion.of_run.test.ball).centre_mm)
        along = np.array([np.cos(np.radians(self.along_deg)), np.sin(np.radians(self.along_deg)), 0.0])
        place_mm = float(along @ centre_mm)
        lift_mm = self.bow_um / 1000.0 * ((place_mm / self.reach_mm) ** 2 - 1.0)
        slope = self.bow_um / 1000.0 * 2.0 * place_mm / self.reach_mm**2
        return plan.jig_rotation @ (lift_mm * np.array([0.0, 0.0, 1.0]) - slope * centre_mm[2] * along)


@dataclass(frozen=True)
class BarCyclic(Mechanism):
    """The bar's scale is interpolated with an error that repeats with its signal period [µm]."""

    name: ClassVar[str] = "bar-cyclic"

    amplitude_um: float = 0.5
    period_um: float = 20.0
    phase_deg: float = 0.0

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del motion, platform
        turns = length_mm * 1000.0 / self.period_um
        return self.amplitude_um / 1000.0 * np.sin(2 * np.pi * turns + np.radians(self.phase_deg))


@dataclass(frozen=True)
class BallForm(Mechanism):
    """The fixed ball is out of round: cosines of the bar's angle, by how often per turn, amplitude [µm], phase [deg]."""

    name: ClassVar[str] = "ball-form"

    waves: tuple[tuple[int, float, float], ...] = ((2, 0.4, 20.0), (3, 0.3, 70.0))

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del platform, length_mm
        return sum(
            (
                amplitude_um / 1000.0 * np.cos(np.radians(count * motion.angle_deg - phase_deg))
                for count, amplitude_um, phase_deg in self.waves
            ),
            start=np.zeros(len(motion.session_s)),
        )
