"""Armature currents of the six strut drives, as a control logs them."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.machine import GRAVITY_M_S2
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.play_operator import follower

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion, Scene


@dataclass(frozen=True)
class DriveCurrents(Mechanism):
    """Current = (load + friction) / gain [N/A] + noise, positive when the motor pulls the platform towards the base.

    The load is the strut's tension plus the axial weight of what moves with it. Friction opposes the drive: a constant
    part [N], one with speed [N s/mm] and one with load (the screw's losses, a share). It turns over within a few µm.
    """

    name: ClassVar[str] = "drive-friction"

    gain_n_a: Six = (400.0, 410.0, 395.0, 405.0, 398.0, 402.0)
    moving_kg: float = 15.0
    coulomb_n: Six = (120.0, 130.0, 110.0, 125.0, 140.0, 115.0)
    viscous_n_s_mm: float = 2.0
    load_share: float = 0.06
    turn_over_um: float = 10.0
    noise_a: float = 0.02
    stream: int = 0

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        del scene
        return replace(self, stream=int(rng.integers(2**31)))

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        axial_n = -self.moving_kg * GRAVITY_M_S2 * platform.direction[:, :, 2]
        load_n = platform.tension_n + axial_n
        half_mm = self.turn_over_um / 2000.0
        travel_mm = motion.commanded_mm
        wound = np.stack(
            [(travel_mm[:, strut] - follower(travel_mm[:, strut], half_mm)) / half_mm for strut in range(6)], axis=1
        )
        friction_n = wound * (np.array(self.coulomb_n) + self.load_share * np.abs(load_n))
        friction_n = friction_n + self.viscous_n_s_mm * motion.strut_speed_mm_s
        rng = np.random.default_rng([self.stream, zlib.crc32(motion.of_run.stem.encode())])
        # A growing strut is paid out: friction then carries part of the load.
        current_a = (load_n - friction_n) / np.array(self.gain_n_a) + self.noise_a * rng.standard_normal(load_n.shape)
        return {f"motor{strut + 1}_current_a": current_a[:, strut] for strut in range(6)}
