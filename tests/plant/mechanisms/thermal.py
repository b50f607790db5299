"""Growth of struts, frame, spindle and jig plate while the machine warms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.warming import Warming

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion

EVEN = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
STRUTS_WARMING = Warming(rise_k=3.0, time_constant_s=2400.0)
SPINDLE_WARMING = Warming(rise_k=4.0, time_constant_s=900.0)
FRAME_WARMING = Warming(rise_k=1.5, time_constant_s=5400.0)


@dataclass(frozen=True)
class ThermalStruts(Mechanism):
    """Every strut grows over its whole length between the joints, strut i warmed by `shares[i]` of the common rise."""

    name: ClassVar[str] = "thermal-struts"

    warming: Warming = STRUTS_WARMING
    expansion_um_m_k: float = 11.5
    shares: tuple[float, float, float, float, float, float] = EVEN
    logged: bool = False

    def _excess_k(self, motion: Motion) -> FloatArray:
        return self.warming.excess_k(motion)[:, None] * np.array(self.shares)

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        return self.expansion_um_m_k * 1e-6 * platform.length_mm * self._excess_k(motion)

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        del platform
        if not self.logged:
            return {}
        temperature_c = motion.scene.ambient_temp_c + self._excess_k(motion)
        return {f"strut{strut + 1}_temp_c": temperature_c[:, strut] for strut in range(6)}


@dataclass(frozen=True)
class ThermalFrame(Mechanism):
    """The base plate grows about its centre, so the base joints move outwards."""

    name: ClassVar[str] = "thermal-frame"

    warming: Warming = FRAME_WARMING
    expansion_um_m_k: float = 11.5
    logged: bool = False

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        growth = self.expansion_um_m_k * 1e-6 * self.warming.excess_k(motion)
        return growth[:, None, None] * motion.machine.base_joints_mm

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        del platform
        return {"machine_temp_c": motion.scene.ambient_temp_c + self.warming.excess_k(motion)} if self.logged else {}


@dataclass(frozen=True)
class SpindleGrowth(Mechanism):
    """The spindle grows out of the platform: the moving ball sinks along the tool axis."""

    name: ClassVar[str] = "spindle-growth"

    warming: Warming = SPINDLE_WARMING
    growth_um_k: float = 3.0
    logged: bool = False

    def tool_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        growth_mm = self.growth_um_k / 1000.0 * self.warming.excess_k(motion)
        return growth_mm[:, None] * np.array([0.0, 0.0, -1.0])

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        del platform
        return {"machine_temp_c": motion.scene.ambient_temp_c + self.warming.excess_k(motion)} if self.logged else {}


@dataclass(frozen=True)
class JigThermal(Mechanism):
    """The jig plate and its holders are warmer than they were on the CMM and have grown about the jig's origin."""

    name: ClassVar[str] = "jig-thermal"

    rise_k: float = 1.0
    expansion_um_m_k: float = 11.5

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        plan = motion.scene.plan
        centre_mm = np.array(plan.ball(motion.of_run.test.ball).centre_mm)
        return plan.jig_rotation @ centre_mm * self.expansion_um_m_k * 1e-6 * self.rise_k
