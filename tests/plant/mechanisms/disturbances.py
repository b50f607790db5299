"""What disturbs a session beside errors of the machine: a wandering bar, its scale, a knocked jig, struts that kink or ring."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.run import Motion, Scene

WALK_STEP_S = 0.5
"""Step of the random walk of a wandering bar."""

RANGE = 5.0
"""Tenths of a millimetre either way over which a scale is bent."""


@dataclass(frozen=True)
class WanderingBar(Mechanism):
    """The bar's zero wanders as a random walk over the whole session [µm per root of a second]."""

    name: ClassVar[str] = "wandering-bar"
    listed: ClassVar[bool] = False

    step_um_root_s: float = 0.1
    walk_um: tuple[float, ...] = ()

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        """One walk for the session, where none is given."""
        if self.walk_um:
            return self
        steps = int(np.ceil(scene.end_s / WALK_STEP_S)) + 2
        walk_um = self.step_um_root_s * np.sqrt(WALK_STEP_S) * np.cumsum(rng.standard_normal(steps))
        return replace(self, walk_um=tuple(walk_um.tolist()))

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        del platform, length_mm
        walk_um = np.array(self.walk_um)
        return np.interp(motion.session_s, WALK_STEP_S * np.arange(len(walk_um)), walk_um) / 1000.0

    def parameters(self) -> dict[str, float]:
        return {"step_um_root_s": self.step_um_root_s}


@dataclass(frozen=True)
class BarScale(Mechanism):
    """The bar's scale is not quite a millimetre per millimetre, and is bent.

    What it shows counts from the length at which it was set on its calibrator, the radius of each test if `set_at_mm` is None: per 0.1 mm
    from there it is off by `linear_um`, and by `curved_um` where it is 0.1 mm away on either side.
    """

    name: ClassVar[str] = "bar-scale"
    listed: ClassVar[bool] = False

    linear_um: float = 0.0
    curved_um: float = 2.0
    set_at_mm: float | None = None

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray:
        """A line and a parabola of the distance `(n,)`; the latter constant beyond its range, in which no circle lies but feed-in does."""
        del platform
        set_at_mm = motion.of_run.path.path.radius_mm if self.set_at_mm is None else self.set_at_mm
        off = (length_mm - set_at_mm) / 0.1
        bent = np.clip(off, -RANGE, RANGE)
        return (self.linear_um * off + self.curved_um * bent**2) / 1000.0


@dataclass(frozen=True)
class BumpedJig(Mechanism):
    """Somebody knocks against the jig plate: from one run on all balls on it stand elsewhere.

    `from_run` counts the runs of the session from zero; an odd one lies between the two directions of a test.
    """

    name: ClassVar[str] = "bumped-jig"
    listed: ClassVar[bool] = False

    shift_um: tuple[float, float, float] = (2.33, -6.43, 0.0)
    from_run: int = 14

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        del platform
        slots = motion.scene.slots
        later = self.from_run < len(slots) and motion.of_run.start_s >= slots[self.from_run].start_s
        return np.array(self.shift_um) / 1000.0 * float(later)


@dataclass(frozen=True)
class KinkedStrut(Mechanism):
    """One strut's scale changes from one length on, as where two pieces of a glass scale meet [µm/m]."""

    name: ClassVar[str] = "kinked-strut"
    listed: ClassVar[bool] = False

    strut: int = 3
    at_mm: float = 760.0
    slope_um_m: float = 500.0

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del motion
        change_mm = np.zeros_like(driven_mm)
        beyond_mm = np.maximum(driven_mm[:, self.strut - 1] - self.at_mm, 0.0)
        change_mm[:, self.strut - 1] = 1e-6 * self.slope_um_m * beyond_mm
        return change_mm


@dataclass(frozen=True)
class RingingStrut(Mechanism):
    """One strut rings after each reversal: a damped oscillation about where it should be."""

    name: ClassVar[str] = "ringing-strut"
    listed: ClassVar[bool] = False

    strut: int = 2
    height_um: float = 4.0
    period_s: float = 0.8
    decay_s: float = 1.5

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        change_mm = np.zeros_like(driven_mm)
        speed_mm_s = motion.strut_speed_mm_s[:, self.strut - 1]
        moving = np.flatnonzero(np.abs(speed_mm_s) > 1e-6)
        for turn in np.flatnonzero(np.diff(np.sign(speed_mm_s[moving])) != 0):
            first = moving[turn + 1]
            since_s = motion.session_s - motion.session_s[first]
            ring_um = np.exp(-since_s / self.decay_s) * np.cos(2.0 * np.pi * since_s / self.period_s)
            side = -np.sign(speed_mm_s[first])
            change_mm[:, self.strut - 1] += np.where(since_s >= 0.0, side * self.height_um / 1000.0 * ring_um, 0.0)
        return change_mm
