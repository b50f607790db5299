"""Effects that stand in no list of hexapod errors: a diagnosis must say "none of those I know", and not bend one to fit.

Each of them could happen in a shop.
"""

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
class OddGearWobble(Mechanism):
    """A belt wheel runs out of true in one strut's drive, at a ratio that no whole turn of the screw has."""

    name: ClassVar[str] = "odd-gear-wobble"
    listed: ClassVar[bool] = False

    strut: int = 3
    amplitude_um: float = 3.0
    turns_per_screw_turn: float = 0.373
    phase_deg: float = 40.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        turns = self.turns_per_screw_turn * driven_mm[:, self.strut - 1] / motion.machine.screw_lead_mm
        change_mm = np.zeros_like(driven_mm)
        change_mm[:, self.strut - 1] = (
            self.amplitude_um / 1000.0 * np.sin(2 * np.pi * turns + np.radians(self.phase_deg))
        )
        return change_mm


@dataclass(frozen=True)
class SoftFloor(Mechanism):
    """The table stands on a floor that gives way: it leans as the platform's weight moves over it.

    The lean [µrad per mm of travel from the centre] turns table, jig and ball about a point far below.
    """

    name: ClassVar[str] = "soft-floor"
    listed: ClassVar[bool] = False

    lean_urad_mm: float = 0.05
    pivot_z_mm: float = -2200.0

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        """Turn times arm `(n, 3)`: weight at +X lowers the +X side, which is a turn about +Y."""
        x_mm, y_mm = platform.position_mm[:, 0], platform.position_mm[:, 1]
        turn_rad = self.lean_urad_mm * 1e-6 * np.stack([-y_mm, x_mm, np.zeros_like(x_mm)], axis=1)
        arm_mm = motion.of_run.path.centre_mm - np.array([0.0, 0.0, self.pivot_z_mm])
        return np.cross(turn_rad, arm_mm)


@dataclass(frozen=True)
class LobedSocket(Mechanism):
    """The magnetic socket of the moving ball was ground on a chuck with seven jaws: seven lobes as the bar goes round."""

    name: ClassVar[str] = "lobed-socket"
    listed: ClassVar[bool] = False

    amplitude_um: float = 1.5
    lobes: int = 7
    phase_deg: float = 15.0

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del platform, length_mm
        return self.amplitude_um / 1000.0 * np.cos(np.radians(self.lobes * motion.angle_deg - self.phase_deg))


@dataclass(frozen=True)
class HoseDrag(Mechanism):
    """A stiff coolant hose pulls the platform towards the place where it comes out of the machine's roof.

    The pull is a spring from the hose's natural length on; what bends is the struts, by their own compliance.
    """

    name: ClassVar[str] = "hose-drag"
    listed: ClassVar[bool] = False

    stiffness_n_mm: float = 0.8
    natural_mm: float = 500.0
    anchor_mm: tuple[float, float, float] = (900.0, 300.0, -200.0)
    on_platform_mm: tuple[float, float, float] = (250.0, 0.0, 550.0)
    compliance_mm_n: float = 9.68e-6

    def _wrench(self, platform: Platform) -> FloatArray:
        arm_mm = platform.rotation @ np.array(self.on_platform_mm)
        hose_mm = np.array(self.anchor_mm) - platform.position_mm - arm_mm
        length_mm = np.linalg.norm(hose_mm, axis=1, keepdims=True)
        force_n = self.stiffness_n_mm * np.maximum(length_mm - self.natural_mm, 0.0) * hose_mm / length_mm
        return np.concatenate([force_n, np.cross(arm_mm, force_n)], axis=1)

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        """Stretch `(n, 6)` by the hose alone, so that it acts whether or not the weight's own stretch is in play."""
        del motion
        wrench = self._wrench(platform)
        return self.compliance_mm_n * np.linalg.solve(platform.jacobian.transpose(0, 2, 1), wrench[:, :, None])[:, :, 0]


@dataclass(frozen=True)
class DentedScrew(Mechanism):
    """Somebody once hit the screw of one strut: a bump at one length, a few millimetres wide."""

    name: ClassVar[str] = "dented-screw"
    listed: ClassVar[bool] = False

    strut: int = 5
    at_mm: float = 775.0
    width_mm: float = 6.0
    height_um: float = 6.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        change_mm = np.zeros_like(driven_mm)
        off = (driven_mm[:, self.strut - 1] - self.at_mm) / self.width_mm
        change_mm[:, self.strut - 1] = self.height_um / 1000.0 * np.exp(-0.5 * off**2)
        return change_mm


@dataclass(frozen=True)
class BuildingSway(Mechanism):
    """The building sways in the wind with a slow beat of its own, and the column of the machine lags behind."""

    name: ClassVar[str] = "building-sway"
    listed: ClassVar[bool] = False

    amplitude_um: float = 2.0
    period_s: float = 11.3
    towards_deg: float = 65.0

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        towards_rad = np.radians(self.towards_deg)
        along = np.array([np.cos(towards_rad), np.sin(towards_rad), 0.0])
        sway_mm = self.amplitude_um / 1000.0 * np.sin(2 * np.pi * motion.session_s / self.period_s)
        return sway_mm[:, None] * along
