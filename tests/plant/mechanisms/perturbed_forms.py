"""Single causes whose law has another form than the textbook's: what no factor beside the law can say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.joints import JointFriction
from tests.plant.mechanisms.play_operator import follower
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.set_up import BarCyclic

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion

NARROWER = (0.3, 0.7, 1.0)
"""Contacts of a nut do not all turn over together: thirds of the gap open over these shares of the transit."""


@dataclass(frozen=True)
class GradualBacklash(Backlash):
    """A strut that turns round crosses its gap over `transit_um` of travel instead of over the gap itself.

    Friction winds up nut and bearings first; play operators in parallel [Prandtl and Ishlinskii's model of friction].
    """

    transit_um: Six = (50.0, 50.0, 50.0, 50.0, 50.0, 50.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        """Minus half the gap while a strut grows, plus half of it while it shrinks, and on the way between `(n, 6)`."""
        del motion
        return np.stack([self._strut(driven_mm[:, strut], strut) for strut in range(6)], axis=1)

    def _strut(self, driven_mm: FloatArray, strut: int) -> FloatArray:
        halves_mm = [share * self.transit_um[strut] / 2000.0 for share in NARROWER]
        wound = [(driven_mm - follower(driven_mm, half_mm)) / half_mm for half_mm in halves_mm]
        return -self.gap_um[strut] / 2000.0 * np.mean(wound, axis=0)


@dataclass(frozen=True)
class BowedScrewLead(ScrewLead):
    """A lead error that changes along the screw: the error at `reach_mm` from zero is off by `bow[i]` of itself."""

    bow: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    reach_mm: float = 150.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        change_mm = super().driven_mm(motion, driven_mm)
        return change_mm * (1.0 + np.array(self.bow) * (driven_mm - self.zero_mm) / self.reach_mm)


@dataclass(frozen=True)
class HarmonicScrewCyclic(ScrewCyclic):
    """A screw error that repeats once per turn without being a sine: `harmonic` of it comes twice per turn."""

    harmonic: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    harmonic_phase_deg: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        turns = driven_mm / motion.machine.screw_lead_mm
        second_mm = np.array(self.amplitude_um) * np.array(self.harmonic) / 1000.0
        phase_rad = np.radians(self.harmonic_phase_deg)
        return super().driven_mm(motion, driven_mm) + second_mm * np.sin(4 * np.pi * turns + phase_rad)


@dataclass(frozen=True)
class HarmonicBarCyclic(BarCyclic):
    """A scale that is interpolated with errors once and, `harmonic` of it, twice per signal period."""

    harmonic: float = 0.0
    harmonic_phase_deg: float = 0.0

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        second = BarCyclic(self.harmonic * self.amplitude_um, self.period_um / 2, self.harmonic_phase_deg)
        return super().reading_mm(motion, platform, length_mm) + second.reading_mm(motion, platform, length_mm)


@dataclass(frozen=True)
class UnevenJointFriction(JointFriction):
    """Joints that rub more at some angles than at others, and more one way than the other.

    The moment is multiplied by `1 + √2 deviation cos(2π angle/period + phase)` and by `1 + asymmetry` while the friction
    pushes the positive way, `1 - asymmetry` the other way.
    """

    deviation: float = 0.0
    period_deg: float = 20.0
    phase_deg: float = 0.0
    asymmetry: float = 0.0

    def _wound(self, angle_rad: FloatArray) -> FloatArray:
        wound = super()._wound(angle_rad)
        turns = np.degrees(angle_rad) / self.period_deg
        along = 1.0 + np.sqrt(2.0) * self.deviation * np.cos(2 * np.pi * turns + np.radians(self.phase_deg))
        return wound * along * (1.0 + self.asymmetry * np.sign(wound))
