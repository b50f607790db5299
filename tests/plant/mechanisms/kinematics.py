"""Kinematic errors: reference lengths of the struts, positions of base and platform joints [CAL II-C]."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.machine import Machine
    from tests.plant.run import Motion, Scene


def _zeros_6() -> FloatArray:
    return np.zeros(6)


def _zeros_63() -> FloatArray:
    return np.zeros((6, 3))


@dataclass(frozen=True)
class Kinematics(Mechanism):
    """Errors that were decided: actual minus what the controller believes [mm]; `(6,)`, `(6, 3)`, `(6, 3)`."""

    name: ClassVar[str] = "kinematics"

    length_mm: FloatArray = field(default_factory=_zeros_6)
    base_mm: FloatArray = field(default_factory=_zeros_63)
    platform_mm: FloatArray = field(default_factory=_zeros_63)

    def built(self, machine: Machine) -> Machine:
        return replace(
            machine,
            base_joints_mm=machine.base_joints_mm + self.base_mm,
            platform_joints_mm=machine.platform_joints_mm + self.platform_mm,
        )

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion, platform
        return self.length_mm


@dataclass(frozen=True)
class RandomKinematics(Mechanism):
    """Errors yet to be drawn: standard deviations per coordinate [mm]."""

    name: ClassVar[str] = "kinematics"

    length_sd_mm: float = 0.05
    base_sd_mm: float = 0.05
    platform_sd_mm: float = 0.0

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        del scene
        return Kinematics(
            self.length_sd_mm * rng.standard_normal(6),
            self.base_sd_mm * rng.standard_normal((6, 3)),
            self.platform_sd_mm * rng.standard_normal((6, 3)),
        )
