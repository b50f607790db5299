"""Mechanisms that follow their law only roughly, as those of real machines do.

Each wraps another mechanism and scales what that does to single struts or balls by a factor near 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion, Scene

LOAD_N = 1000.0
"""About what a strut of the reference machine carries."""
PLATE_MM = 150.0
"""How far from its middle the bores of the jig plate reach."""


@dataclass(frozen=True)
class Perturbed(Mechanism):
    """Does what `law` does; those that inherit from it change that at some of the hooks."""

    law: Mechanism

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.law.name

    @property
    def listed(self) -> bool:  # type: ignore[override]
        return self.law.listed

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        if self.law.drawn(rng, scene) is not self.law:
            raise ValueError(f"{self.name} is random still: draw it, then perturb it")
        return self

    def built(self, machine: Machine) -> Machine:
        return self.law.built(machine)

    def sampled_s(self, motion: Motion) -> FloatArray | None:
        return self.law.sampled_s(motion)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray | None:
        return self.law.driven_mm(motion, driven_mm)

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.lengthening_mm(motion, platform)

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.base_shift_mm(motion, platform)

    def joint_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.joint_shift_mm(motion, platform)

    def load(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.load(motion, platform)

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.fixed_ball_mm(motion, platform)

    def tool_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        return self.law.tool_ball_mm(motion, platform)

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray | None:
        return self.law.reading_mm(motion, platform, length_mm)

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        return self.law.columns(motion, platform)

    def parameters(self) -> dict[str, Any]:
        own = {key: value for key, value in vars(self).items() if key != "law"}
        before = self.law.parameters()
        return {**before, "perturbed": [*before.get("perturbed", ()), {"form": type(self).__name__, **own}]}


class ScaledStruts(Perturbed):
    """What the law does to strut i and its joints is multiplied by a factor."""

    def factor(self, motion: Motion, platform: Platform | None) -> FloatArray:
        """Factors `(6,)` or `(n, 6)`; no platform is known yet where drives are asked what they do."""
        raise NotImplementedError

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray | None:
        change_mm = self.law.driven_mm(motion, driven_mm)
        return None if change_mm is None else change_mm * self.factor(motion, None)

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        change_mm = self.law.lengthening_mm(motion, platform)
        return None if change_mm is None else change_mm * self.factor(motion, platform)

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        change_mm = self.law.base_shift_mm(motion, platform)
        return None if change_mm is None else change_mm * self.factor(motion, platform)[..., None]

    def joint_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        change_mm = self.law.joint_shift_mm(motion, platform)
        return None if change_mm is None else change_mm * self.factor(motion, platform)[..., None]


@dataclass(frozen=True)
class FromStrutToStrut(ScaledStruts):
    """Struts of one make are not alike: strut i has `deviation[i]` more than the law says."""

    deviation: Six

    def factor(self, motion: Motion, platform: Platform | None) -> FloatArray:
        del motion, platform
        return 1.0 + np.array(self.deviation)


@dataclass(frozen=True)
class AlongStrut(ScaledStruts):
    """The effect varies along each strut: a cosine of its commanded length with its own wavelength and phase.

    `deviation` is the root mean square of the relative deviation over whole waves.
    """

    deviation: float
    wavelength_mm: Six
    phase_deg: Six

    def factor(self, motion: Motion, platform: Platform | None) -> FloatArray:
        del platform
        turns = motion.commanded_mm / np.array(self.wavelength_mm)
        return 1.0 + np.sqrt(2.0) * self.deviation * np.cos(2 * np.pi * turns + np.radians(self.phase_deg))


@dataclass(frozen=True)
class ByLoad(ScaledStruts):
    """Contacts that stiffen under load: `1 + deviation (T0 - |T|) / (T0 + |T|)` at tension T, with T0 of 1 kN."""

    deviation: float

    def factor(self, motion: Motion, platform: Platform | None) -> FloatArray:
        del motion
        if platform is None:
            raise ValueError(f"{self.name} acts in the drives, where no load is known yet")
        load_n = np.abs(platform.tension_n)
        return 1.0 + self.deviation * (LOAD_N - load_n) / (LOAD_N + load_n)


@dataclass(frozen=True)
class ByDirection(ScaledStruts):
    """Growing struts have `deviation[i]` more than the law says, shrinking ones so much less."""

    deviation: Six

    def factor(self, motion: Motion, platform: Platform | None) -> FloatArray:
        del platform
        return 1.0 + np.array(self.deviation) * _last_direction(motion.commanded_mm)


def _last_direction(length_mm: FloatArray) -> FloatArray:
    """Sign `(n, 6)` of the last change of lengths `(n, 6)`; 0 before the first."""
    step = np.sign(np.diff(length_mm, axis=0, prepend=length_mm[:1]))
    latest = np.maximum.accumulate(np.where(step != 0.0, np.arange(len(step))[:, None], 0), axis=0)
    return np.take_along_axis(step, latest, axis=0)


@dataclass(frozen=True)
class AcrossPlate(Perturbed):
    """A plate that is not the same everywhere: the ball moves by `deviation` more at the plate's edge towards an angle."""

    deviation: float
    towards_deg: float

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        shift_mm = self.law.fixed_ball_mm(motion, platform)
        if shift_mm is None:
            return None
        centre_mm = np.array(motion.scene.plan.ball(motion.of_run.test.ball).centre_mm)
        towards_rad = np.radians(self.towards_deg)
        out_mm = float(centre_mm[:2] @ [np.cos(towards_rad), np.sin(towards_rad)])
        return shift_mm * (1.0 + self.deviation * out_mm / PLATE_MM)
