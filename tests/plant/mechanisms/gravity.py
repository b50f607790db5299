"""Struts that stretch under the weight of the platform [GRAV 3.1].

Tensions follow from the balance of the rigid platform, with signs: a strut that pulls stretches, one that pushes
shortens. [GRAV eq 7] prints the force's magnitude; taken at its word every strut would stretch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.machine import Machine
    from tests.plant.run import Motion

REFERENCE_LENGTH_MM = 1000.0


@dataclass(frozen=True)
class Gravity(Mechanism):
    """`ΔL = K (α L + C_B) T` [GRAV eq 7], written as the compliance at 1 m and the share of it that grows with length."""

    name: ClassVar[str] = "gravity"

    compliance_mm_n: float = 9.68e-6
    share_with_length: float = 0.9

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        """Elastic stretch `(n, 6)`; the length in it is the driven one, whose stretch is of second order."""
        del motion
        relative_length = platform.length_mm / REFERENCE_LENGTH_MM
        compliance = self.compliance_mm_n * (1.0 - self.share_with_length + self.share_with_length * relative_length)
        return compliance * platform.tension_n


@dataclass(frozen=True)
class CentreOfGravityShift(Mechanism):
    """The platform's centre of gravity is not where the machine file says [GRAV 3.2]; platform frame [mm]."""

    name: ClassVar[str] = "cog-shift"

    shift_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def built(self, machine: Machine) -> Machine:
        x_mm, y_mm, z_mm = (
            at_mm + by_mm for at_mm, by_mm in zip(machine.centre_of_gravity_mm, self.shift_mm, strict=True)
        )
        return replace(machine, centre_of_gravity_mm=(x_mm, y_mm, z_mm))
