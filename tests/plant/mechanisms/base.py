"""What a mechanism can do to the machine, the balls and the bar.

A mechanism is one physical cause. It overrides the hooks at which it acts; the others say None, "no effect here".
All hooks get the whole motion in time order, so that effects with a history can walk through it. Hooks that get the
platform are asked again and again while the pose is being sought, each time with the platform as deflected so far.
"""

from __future__ import annotations

from dataclasses import asdict, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    import numpy as np

    from tests.plant.arrays import FloatArray
    from tests.plant.hexapod import Platform
    from tests.plant.machine import Machine
    from tests.plant.run import Motion, Scene


class Mechanism:
    """One physical cause; by itself it does nothing."""

    name: ClassVar[str]
    listed: ClassVar[bool] = True
    """False for an outsider: an effect that no catalogue of hexapod errors has."""

    def drawn(self, rng: np.random.Generator, scene: Scene) -> Mechanism:
        del rng, scene
        return self

    def built(self, machine: Machine) -> Machine:
        return machine

    def sampled_s(self, motion: Motion) -> FloatArray | None:
        """Shift [s] `()` or `(n,)` of the instant of a sample against the time written beside it."""

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray | None:
        """Change `(n, 6)` of what the drives make of the strut lengths asked of them."""

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Growth `(6,)` or `(n, 6)` of the struts beyond what was driven."""

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Shift `(6, 3)` or `(n, 6, 3)` of the base joints, machine frame."""

    def joint_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Shift `(6, 3)` or `(n, 6, 3)` of the platform joints, platform frame."""

    def load(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Force [N] and moment about the tip [N mm] `(n, 6)` on the platform, besides its weight."""

    def fixed_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Shift `(3,)` or `(n, 3)` of the fixed ball, machine frame."""

    def tool_ball_mm(self, motion: Motion, platform: Platform) -> FloatArray | None:
        """Shift `(3,)` or `(n, 3)` of the moving ball, platform frame."""

    def reading_mm(self, motion: Motion, platform: Platform, length_mm: FloatArray) -> FloatArray | None:
        """Change `()` or `(n,)` of what the bar reads at true ball distances `(n,)`."""

    def columns(self, motion: Motion, platform: Platform) -> dict[str, FloatArray]:
        """Further columns `(n,)` of the recording, by their name there."""
        del motion, platform
        return {}

    def parameters(self) -> dict[str, Any]:
        return asdict(self) if is_dataclass(self) else {}
