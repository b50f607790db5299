"""Weights besides the platform's, and what gives way under load besides the struts' length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.machine import GRAVITY_M_S2
from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion

DOWN = np.array([0.0, 0.0, -1.0])


def across(direction: FloatArray) -> FloatArray:
    """Part `(n, 6, 3)` of the unit vector down that is square to struts `(n, 6, 3)`."""
    return DOWN - direction * (direction @ DOWN)[:, :, None]


@dataclass(frozen=True)
class StrutWeight(Mechanism):
    """Struts and motors rest on their base joints and, by leverage, on the platform [GRAV eq 2].

    A mass m at distance s from the base joint presses on the platform with `m (s/L) g⊥`. A uniform rod between the
    joints has s = L/2, a motor behind the base joint a negative s; a screw of fixed length slides through the base
    joint and has its middle at `L - length/2`. (The printed equation has the opposite sign: it is the force of the
    platform on the strut.)
    """

    name: ClassVar[str] = "strut-weight"

    rod_kg: float = 25.0
    motor_kg: float = 20.0
    motor_length_mm: float = 300.0
    screw_kg: float = 0.0
    screw_length_mm: float = 1400.0

    def transverse_n(self, platform: Platform) -> FloatArray:
        """Force on each platform joint `(n, 6, 3)`."""
        length_mm = platform.length_mm
        effective_kg = (
            self.rod_kg / 2
            - self.motor_kg * self.motor_length_mm / (2 * length_mm)
            + self.screw_kg * (length_mm - self.screw_length_mm / 2) / length_mm
        )
        return (effective_kg * GRAVITY_M_S2)[:, :, None] * across(platform.direction)

    def load(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion
        force_n = self.transverse_n(platform)
        return np.concatenate([force_n.sum(axis=1), np.cross(platform.arm_mm, force_n).sum(axis=1)], axis=1)


@dataclass(frozen=True)
class BaseCompliance(Mechanism):
    """The frame gives way under the pull of each strut [mm/N], along machine X, Y, Z."""

    name: ClassVar[str] = "base-compliance"

    compliance_mm_n: tuple[float, float, float] = (1e-6, 1e-6, 3e-6)

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion
        return np.array(self.compliance_mm_n) * platform.tension_n[:, :, None] * platform.direction


@dataclass(frozen=True)
class StrutBending(Mechanism):
    """A strut sags under its own weight and its ends come closer by half the integral of the squared slope.

    For a uniform pinned beam under a transverse load w per length that is `17 w² L⁷ / (40320 (E I)²)`.
    """

    name: ClassVar[str] = "strut-bending"

    rod_kg: float = 25.0
    bending_stiffness_n_mm2: float = 1.0e10

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion
        length_mm = platform.length_mm
        load_n_mm = self.rod_kg * GRAVITY_M_S2 * np.linalg.norm(across(platform.direction), axis=2) / length_mm
        return -17.0 / 40320.0 * (load_n_mm / self.bending_stiffness_n_mm2) ** 2 * length_mm**7
