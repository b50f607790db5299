"""Joints that rub, or whose centre is not a point."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tests.plant.hexapod import Platform, commanded_platform
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.play_operator import follower

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion

HOME = np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]])


def joint_axes(machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Axes of the 2-DOF base joints `(6, 3)` each: the first fixed in the base and level, the second square to it.

    An assumption, as no paper gives them; both are square to the strut when the platform is at home.
    """
    home = commanded_platform(machine, HOME).direction[0]
    first = np.cross(home, [0.0, 0.0, 1.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(home, first)


def joint_angles_rad(machine: Machine, direction: FloatArray) -> FloatArray:
    """Turn about the first and the second axis `(n, 6, 2)` since home, of struts along `(n, 6, 3)`."""
    first, second = joint_axes(machine)
    home = commanded_platform(machine, HOME).direction[0]
    along, side, level = (np.einsum("nij,ij->ni", direction, axis) for axis in (home, second, first))
    return np.stack([np.arctan2(-side, along), np.arcsin(level)], axis=2)


@dataclass(frozen=True)
class JointFriction(Mechanism):
    """Base joints rub: a moment [N mm] against the turn of each axis, built up over a small wind-up angle [µrad].

    A strut held back by a moment M at its base pushes the platform sideways with M/L, and the struts' own compliance
    turns that into an error: hysteresis that changes sign where a joint turns round, not where a strut does.
    """

    name: ClassVar[str] = "joint-friction"

    moment_n_mm: float = 2.0e4
    wind_up_urad: float = 100.0
    compliance_mm_n: float = 9.68e-6
    shares: Six = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """Of the moment, joint by joint."""

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        commanded = commanded_platform(motion.machine, motion.commanded)
        angle_rad = joint_angles_rad(motion.machine, commanded.direction)
        share = np.stack([self.shares[strut] * self._wound(angle_rad[:, strut]) for strut in range(6)], axis=1)
        # A turn about an axis moves the strut's end along axis × direction; friction pushes the other way.
        ways = [np.cross(axis, platform.direction) for axis in joint_axes(motion.machine)]
        force_n = (
            -sum(share[:, :, [k]] * ways[k] for k in range(2)) * (self.moment_n_mm / platform.length_mm)[:, :, None]
        )
        wrench = np.concatenate([force_n.sum(axis=1), np.cross(platform.arm_mm, force_n).sum(axis=1)], axis=1)
        return self.compliance_mm_n * np.linalg.solve(platform.jacobian.transpose(0, 2, 1), wrench[:, :, None])[:, :, 0]

    def _wound(self, angle_rad: FloatArray) -> FloatArray:
        """How far `(n, 2)` the friction of both axes is built up, -1 to 1."""
        half_rad = self.wind_up_urad * 1e-6
        return np.stack([(angle_rad[:, k] - follower(angle_rad[:, k], half_rad)) / half_rad for k in range(2)], axis=1)


@dataclass(frozen=True)
class UjointScrew(Mechanism):
    """A screw held by universal joints at both ends is turned by them as the strut swings: lead/2π of length per turn.

    The joints' first axes are level when the platform is at home. Controls correct for most of it; `share` is what
    they leave. A twist of the platform end against the base end in the sense of a right-hand screw lengthens.
    """

    name: ClassVar[str] = "ujoint-screw"

    share: float = 0.02

    def lengthening_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        home = commanded_platform(motion.machine, HOME)
        since_home_rad = _twist_rad(motion.machine, platform) - _twist_rad(motion.machine, home)
        return self.share * motion.machine.screw_lead_mm / (2 * np.pi) * since_home_rad


def _twist_rad(machine: Machine, platform: Platform) -> FloatArray:
    """Turn about the strut `(n, 6)` from the base joint's cross to the platform joint's."""
    first, _ = joint_axes(machine)
    u = platform.direction
    base_cross = np.cross(first, u)
    platform_cross = np.cross(first @ platform.rotation.transpose(0, 2, 1), u)
    across = np.einsum("nij,nij->ni", u, np.cross(base_cross, platform_cross))
    return np.arctan2(across, np.einsum("nij,nij->ni", base_cross, platform_cross))


def _zeros_63() -> FloatArray:
    return np.zeros((6, 3))


@dataclass(frozen=True)
class JointRunout(Mechanism):
    """The strut's axis misses the joint's first axis by `(6, 3)` [µm], and goes round with it.

    At the platform the first axis is fixed in the platform, in the direction that the base joint's has at home.
    """

    name: ClassVar[str] = "joint-runout"

    eccentricity_um: FloatArray = field(default_factory=_zeros_63)
    platform_eccentricity_um: FloatArray = field(default_factory=_zeros_63)

    def base_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        return _orbit_mm(motion.machine, platform.direction, np.asarray(self.eccentricity_um) / 1000.0)

    def joint_shift_mm(self, motion: Motion, platform: Platform) -> FloatArray:
        """The same at the platform, by the strut's direction as the platform sees it `(n, 6, 3)`."""
        return _orbit_mm(
            motion.machine, platform.direction @ platform.rotation, np.asarray(self.platform_eccentricity_um) / 1000.0
        )


def _orbit_mm(machine: Machine, direction: FloatArray, e_mm: FloatArray) -> FloatArray:
    """Change `(n, 6, 3)` of an arm `(6, 3)` that turns about the first axes with struts along `(n, 6, 3)` (Rodrigues)."""
    first, _ = joint_axes(machine)
    turn_rad = joint_angles_rad(machine, direction)[:, :, :1]
    inside = first * np.einsum("ij,ij->i", first, e_mm)[:, None]
    return (np.cos(turn_rad) - 1.0) * (e_mm - inside) + np.sin(turn_rad) * np.cross(first, e_mm)
