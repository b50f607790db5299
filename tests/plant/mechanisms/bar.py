"""The bar itself: its length is not quite what its calibrator said, and it warms in the hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.warming import Warming

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion, Scene

BAR_WARMING = Warming(rise_k=2.0, time_constant_s=1200.0)


@dataclass(frozen=True)
class BarOffset(Mechanism):
    """Every reading of the session is longer than the truth by a constant [µm]."""

    name: ClassVar[str] = "bar-offset"

    offset_um: float = 0.0

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del motion, platform, length_mm
        return np.array(self.offset_um / 1000.0)


@dataclass(frozen=True)
class RandomBarOffset(Mechanism):
    """The bar's length is off at random, by the standard uncertainty of its calibrator [µm]."""

    name: ClassVar[str] = "bar-offset"

    sd_um: float = 0.5

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        del scene
        return BarOffset(self.sd_um * float(rng.standard_normal()))


@dataclass(frozen=True)
class BarDrift(Mechanism):
    """The bar warms; its rod grows, so less of the scale comes out and the reading falls below the truth."""

    name: ClassVar[str] = "bar-drift"

    warming: Warming = BAR_WARMING
    expansion_um_m_k: float = 10.6
    logged: bool = False

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del platform
        return -self.expansion_um_m_k * 1e-6 * length_mm * self.warming.excess_k(motion)

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        del platform
        return {"bar_temp_c": motion.scene.ambient_temp_c + self.warming.excess_k(motion)} if self.logged else {}
