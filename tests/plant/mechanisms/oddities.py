"""More effects that stand in no list of hexapod errors; like the outsiders, each of them could happen in a shop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion


def _of_strut(change_mm: FloatArray, strut: int) -> FloatArray:
    """The change `(n,)` of one strut, 1 to 6, as that of all `(n, 6)`."""
    all_mm = np.zeros((len(change_mm), 6))
    all_mm[:, strut - 1] = change_mm
    return all_mm


@dataclass(frozen=True)
class BentCover(Mechanism):
    """A telescopic cover of one strut rubs along one stretch of its travel and bends it: a smooth bump, wide."""

    name: ClassVar[str] = "bent-cover"
    listed: ClassVar[bool] = False

    strut: int = 2
    at_mm: float = 740.0
    width_mm: float = 25.0
    height_um: float = 4.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        off = np.clip((driven_mm[:, self.strut - 1] - self.at_mm) / self.width_mm, -1.0, 1.0)
        return _of_strut(self.height_um / 2000.0 * (1.0 + np.cos(np.pi * off)), self.strut)


@dataclass(frozen=True)
class SpringyDrive(Mechanism):
    """The belt of one strut's drive gives way under acceleration [µm per m/s²]."""

    name: ClassVar[str] = "springy-drive"
    listed: ClassVar[bool] = False

    strut: int = 4
    give_um_s2_m: float = 500.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        if len(driven_mm) == 1:
            return np.zeros_like(driven_mm)
        speed_mm_s = motion.strut_speed_mm_s[:, self.strut - 1]
        acceleration_m_s2 = np.gradient(speed_mm_s, motion.session_s) / 1000.0
        return _of_strut(-self.give_um_s2_m / 1000.0 * acceleration_m_s2, self.strut)


@dataclass(frozen=True)
class CreepingSpindle(Mechanism):
    """The spindle is not clamped: the bar drags it round by a share of its own turn, and the socket runs out."""

    name: ClassVar[str] = "creeping-spindle"
    listed: ClassVar[bool] = False

    runout_um: float = 5.0
    share: float = 3.0
    phase_deg: float = 20.0

    def tool_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        angle_rad = np.radians(self.share * motion.angle_deg + self.phase_deg)
        circle = np.stack([np.cos(angle_rad), np.sin(angle_rad), np.zeros_like(angle_rad)], axis=1)
        return self.runout_um / 1000.0 * circle


@dataclass(frozen=True)
class RockingTable(Mechanism):
    """One foot of the table is loose: it tips over as the platform's weight crosses a line, and the ball with it."""

    name: ClassVar[str] = "rocking-table"
    listed: ClassVar[bool] = False

    tip_um: tuple[float, float, float] = (3.0, 1.0, 1.0)
    across_deg: float = 35.0
    line_mm: float = 20.0
    soft_mm: float = 15.0

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del motion
        across_rad = np.radians(self.across_deg)
        side_mm = platform.position_mm[:, :2] @ np.array([np.cos(across_rad), np.sin(across_rad)]) - self.line_mm
        return np.tanh(side_mm / self.soft_mm)[:, None] * np.array(self.tip_um) / 2000.0


@dataclass(frozen=True)
class CyclingChiller(Mechanism):
    """The cooling of one strut's motor switches on and off: its length follows as a saw-tooth of time."""

    name: ClassVar[str] = "cycling-chiller"
    listed: ClassVar[bool] = False

    strut: int = 6
    height_um: float = 3.0
    period_s: float = 43.0

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        part = np.mod(motion.session_s / self.period_s, 1.0)
        tooth = np.where(part < 0.75, part / 0.75, (1.0 - part) / 0.25) - 0.5
        return _of_strut(self.height_um / 1000.0 * tooth, self.strut)


@dataclass(frozen=True)
class WindingCable(Mechanism):
    """The bar's cable winds round the spindle as the bar goes round, and pulls more the more it is wound."""

    name: ClassVar[str] = "winding-cable"
    listed: ClassVar[bool] = False

    pull_um: float = 2.0

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del platform, length_mm
        turned = (motion.angle_deg - motion.of_run.path.path.start_deg) / 360.0
        return self.pull_um / 1000.0 * turned**2
