"""Where the platform is: struts, their directions and tensions, and the step that finds it.

With `u` the unit vector of a strut from base to platform joint and `a = R P` the arm of its platform joint,
a small motion of the platform changes the strut lengths by `J = [u, a × u]`, `(n, 6, 6)`, and tensions `T` balance
a wrench on the platform when `Jᵀ T` equals it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tests.plant.machine import GRAVITY_M_S2, Machine
from tests.plant.rotation import rotation_matrix, turned

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.arrays import FloatArray


@dataclass(frozen=True)
class Guess:
    """A pose near the sought one, `(n, 3)` and `(n, 3, 3)`, with the inverse `(n, 6, 6)` of the Jacobian there."""

    position_mm: FloatArray
    rotation: FloatArray
    inverse_jacobian: FloatArray


class Platform:
    """The platform at n instants: position `(n, 3)` of the tool tip, rotation `(n, 3, 3)`, joints `(n or 1, 6, 3)`."""

    def __init__(
        self,
        position_mm: FloatArray,
        rotation: FloatArray,
        base_mm: FloatArray,
        joints_mm: FloatArray,
        machine: Machine,
    ) -> None:
        self.position_mm = position_mm
        self.rotation = rotation
        self.base_mm = base_mm
        self.machine = machine
        self.arm_mm = joints_mm @ rotation.transpose(0, 2, 1)
        self.strut_mm = self.arm_mm + position_mm[:, None, :] - base_mm
        self.length_mm = np.sqrt(np.einsum("nij,nij->ni", self.strut_mm, self.strut_mm))
        self.extra_loads: list[Callable[[Platform], FloatArray | None]] = []
        self.inverse_jacobian: FloatArray | None = None

    @cached_property
    def direction(self) -> FloatArray:
        """Unit vectors `(n, 6, 3)` from base to platform joint."""
        return self.strut_mm / self.length_mm[:, :, None]

    @cached_property
    def jacobian(self) -> FloatArray:
        """`(n, 6, 6)`: strut length by platform motion (translation, rotation about the tip; machine frame)."""
        return np.concatenate([self.direction, _cross(self.arm_mm, self.direction)], axis=2)

    @cached_property
    def wrench(self) -> FloatArray:
        """Force [N] and moment about the tip [N mm] on the platform, `(n, 6)`: its weight and all extra loads."""
        weight_n = np.array([0.0, 0.0, -self.machine.platform_kg * GRAVITY_M_S2])
        arm_mm = self.rotation @ np.array(self.machine.centre_of_gravity_mm)
        total = np.concatenate([np.broadcast_to(weight_n, arm_mm.shape), np.cross(arm_mm, weight_n)], axis=1)
        for load in self.extra_loads:
            extra = load(self)
            if extra is not None:
                total = total + extra
        return total

    @cached_property
    def tension_n(self) -> FloatArray:
        """Strut tensions [N] `(n, 6)`, positive where a strut pulls the platform towards the base.

        Solves `Jᵀ T = wrench`. A Jacobian inverted nearby turns that into a few multiplications: each refinement
        shrinks the error by the relative distance between the two poses.
        """
        if self.inverse_jacobian is None:
            return np.linalg.solve(self.jacobian.transpose(0, 2, 1), self.wrench[:, :, None])[:, :, 0]
        tension_n = np.zeros_like(self.wrench)
        for _ in range(20):
            open_wrench = self.wrench - _times_transposed(self.jacobian, tension_n)
            step_n = _times_transposed(self.inverse_jacobian, open_wrench)
            tension_n = tension_n + step_n
            if np.abs(step_n).max() < 1e-6:
                break
        return tension_n


def commanded_platform(machine: Machine, poses: FloatArray) -> Platform:
    """The platform of the machine exactly at poses `(n, 6)` [mm, deg]."""
    rotation = rotation_matrix(poses[:, 3:], machine.rotation)
    return Platform(poses[:, :3], rotation, machine.base_joints_mm[None], machine.platform_joints_mm[None], machine)


def strut_lengths(machine: Machine, poses: FloatArray) -> FloatArray:
    """Strut lengths [mm] `(n, 6)` at poses `(n, 6)` [CAL eq 1]."""
    return commanded_platform(machine, poses).length_mm


def guess_at(machine: Machine, poses: FloatArray) -> Guess:
    platform = commanded_platform(machine, poses)
    return Guess(platform.position_mm, platform.rotation, np.linalg.inv(platform.jacobian))


def stepped(platform: Platform, inverse_jacobian: FloatArray, missing_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One Newton step [CAL eq 2]: position and rotation after strut lengths changed by `missing_mm` `(n, 6)`."""
    move = (inverse_jacobian @ missing_mm[:, :, None])[:, :, 0]
    return platform.position_mm + move[:, :3], turned(platform.rotation, move[:, 3:])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    # numpy.cross moves axes about; written out it takes a third of the time.
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def _times_transposed(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    return (vector[:, None, :] @ matrix)[:, 0, :]
