"""Errors of the ball screws: of their lead, and once per turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.run import Motion

Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class ScrewLead(Mechanism):
    """A screw's lead is too long by so many µm per metre; the error is nothing at `zero_mm` of strut length."""

    name: ClassVar[str] = "screw-lead"

    error_um_m: Six = (20.0, 20.0, 20.0, 20.0, 20.0, 20.0)
    zero_mm: float = 750.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        return np.array(self.error_um_m) * 1e-6 * (driven_mm - self.zero_mm)


@dataclass(frozen=True)
class ScrewCyclic(Mechanism):
    """The screw or its encoder runs out of true: a sine once per turn; phases are those at strut length nothing."""

    name: ClassVar[str] = "screw-cyclic"

    amplitude_um: Six = (1.5, 1.5, 1.5, 1.5, 1.5, 1.5)
    phase_deg: Six = (0.0, 60.0, 130.0, 200.0, 250.0, 310.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        turns = driven_mm / motion.machine.screw_lead_mm
        return np.array(self.amplitude_um) / 1000.0 * np.sin(2 * np.pi * turns + np.radians(self.phase_deg))
