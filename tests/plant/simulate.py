"""From a commanded motion to the true pose and the true reading of the bar.

    actual pose = F⁻¹( F(T; nominal) - reference length errors + strut errors ; Q + ΔQ, P + ΔP )

Strut errors that depend on forces depend on the pose that they bend, so both are sought together: every round asks the
mechanisms at the pose found so far and makes one Newton step [CAL eq 2] towards the strut lengths that they name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tests.plant.hexapod import Guess, Platform, guess_at, stepped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from tests.plant.arrays import FloatArray
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.run import Motion

TOLERANCE_MM = 1e-9
ROUNDS = 60


@dataclass(frozen=True)
class Outcome:
    """What really happened at n instants: the platform, and in a run what the bar reads without noise `(n,)`."""

    motion: Motion
    platform: Platform
    length_mm: FloatArray


def built_machine(nominal: Machine, mechanisms: Sequence[Mechanism]) -> Machine:
    for mechanism in mechanisms:
        nominal = mechanism.built(nominal)
    return nominal


def true_platform(motion: Motion, mechanisms: Sequence[Mechanism]) -> Platform:
    actual = built_machine(motion.machine, mechanisms)
    driven_mm = motion.commanded_mm
    for mechanism in mechanisms:
        change_mm = mechanism.driven_mm(motion, driven_mm)
        if change_mm is not None:
            driven_mm = driven_mm + change_mm
    guess = guess_at(motion.machine, motion.commanded)
    nominal = Platform(
        guess.position_mm, guess.rotation, actual.base_joints_mm[None], actual.platform_joints_mm[None], actual
    )
    platform = _equipped(nominal, motion, mechanisms, guess)
    for _ in range(ROUNDS):
        target_mm = _total(driven_mm, (mechanism.lengthening_mm(motion, platform) for mechanism in mechanisms))
        base_mm = _total(
            actual.base_joints_mm[None], (mechanism.base_shift_mm(motion, platform) for mechanism in mechanisms)
        )
        joints_mm = _total(
            actual.platform_joints_mm[None], (mechanism.joint_shift_mm(motion, platform) for mechanism in mechanisms)
        )
        placed = Platform(platform.position_mm, platform.rotation, base_mm, joints_mm, actual)
        missing_mm = target_mm - placed.length_mm
        if np.abs(missing_mm).max() < TOLERANCE_MM:
            return platform
        position_mm, rotation = stepped(placed, guess.inverse_jacobian, missing_mm)
        platform = _equipped(Platform(position_mm, rotation, base_mm, joints_mm, actual), motion, mechanisms, guess)
    raise ArithmeticError(f"no pose fits the struts: {np.abs(missing_mm).max():.3g} mm remain")


def ball_vector_mm(motion: Motion, platform: Platform, mechanisms: Sequence[Mechanism]) -> FloatArray:
    """From the fixed ball to the moving ball `(n, 3)`, machine frame."""
    fixed_mm = _total(
        motion.of_run.path.centre_mm, (mechanism.fixed_ball_mm(motion, platform) for mechanism in mechanisms)
    )
    offset_mm = _total(np.zeros(3), (mechanism.tool_ball_mm(motion, platform) for mechanism in mechanisms))
    turned_mm = (platform.rotation @ np.broadcast_to(offset_mm, platform.position_mm.shape)[:, :, None])[:, :, 0]
    return platform.position_mm + turned_mm - fixed_mm


def simulate(motion: Motion, mechanisms: Sequence[Mechanism]) -> Outcome:
    platform = true_platform(motion, mechanisms)
    distance_mm = np.linalg.norm(ball_vector_mm(motion, platform, mechanisms), axis=1)
    length_mm = _total(distance_mm, (mechanism.reading_mm(motion, platform, distance_mm) for mechanism in mechanisms))
    return Outcome(motion, platform, length_mm)


def _equipped(platform: Platform, motion: Motion, mechanisms: Sequence[Mechanism], guess: Guess) -> Platform:
    def load_of(mechanism: Mechanism) -> Callable[[Platform], FloatArray | None]:
        return lambda loaded: mechanism.load(motion, loaded)

    platform.extra_loads = [load_of(mechanism) for mechanism in mechanisms]
    platform.inverse_jacobian = guess.inverse_jacobian
    return platform


def _total(start: FloatArray, changes: Iterable[FloatArray | None]) -> FloatArray:
    total = start
    for change in changes:
        if change is not None:
            total = total + change
    return total
