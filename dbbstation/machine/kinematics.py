"""Inverse and forward kinematics, and sensitivities of a bar reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import in_blocks
from dbbstation.errors import KinematicsError
from dbbstation.machine import kernels
from dbbstation.machine.geometry import STRUTS, Frames, Hexapod

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

TOLERANCE_MM = 1e-11
"""Strut length residual at which the forward kinematics stops: the pose is then within 1e-9 mm."""

PARAMETERS = 4 * STRUTS
"""The 24 parameters of [CAL II-C]: strut lengths and base-joint coordinates."""

MOST_STEPS = 25
"""Most Newton steps: three suffice from a commanded pose; after ten no nearby pose exists."""


@dataclass(frozen=True)
class Struts:
    """Struts at given poses.

    Attributes:
        unit: from base to platform joint, machine frame, shape (n, 6, 3) [1].
        arm_mm: R P, tool tip to platform joint in machine axes, shape (n, 6, 3).
    """

    length_mm: Floats
    unit: Floats
    arm_mm: Floats


def inverse(hexapod: Hexapod, frames: Frames) -> Struts:
    """Return strut lengths and directions at `frames` [CAL eq 1].

    Raises:
        ValueError: moving joints do not match the poses.
    """
    span, arm = _spans(hexapod, frames)
    length = _lengths(span)
    return Struts(length, span / length[..., np.newaxis], arm)


def strut_lengths(hexapod: Hexapod, frames: Frames) -> Floats:
    """Return strut lengths at `frames`, shape (n, 6) [mm] [CAL eq 1].

    Raises:
        ValueError: moving joints do not match the poses.
    """
    return _lengths(_spans(hexapod, frames)[0])


def forward(hexapod: Hexapod, length_mm: Floats, near: Frames) -> Frames:
    """Return the poses of these strut lengths within 1e-11 mm [CAL eq 2].

    Args:
        near: starting values of Newton-Raphson, usually commanded poses.

    Raises:
        KinematicsError: lengths without pose; names the first.
    """
    count = len(near)
    found = Frames(np.empty((count, 3)), np.empty((count, 3, 3)))
    target = np.ascontiguousarray(length_mm)
    outcome = np.empty(count, dtype=np.int64)
    machine = (target, *_joints(hexapod, count), TOLERANCE_MM, MOST_STEPS)
    frames = (near.position_mm, near.rotation, found.position_mm, found.rotation)
    in_blocks(kernels.forward, count, *machine, *frames, outcome)
    failed = outcome != kernels.CONVERGED
    if failed.any():
        first = int(np.argmax(failed))
        # A NaN length makes a NaN pose, which counts as singular.
        singular = bool(outcome[first] == kernels.SINGULAR and np.isfinite(target[first]).all())
        _refuse(first, near, hexapod, target, singular=singular)
    return found


def strut_jacobian(struts: Struts) -> Floats:
    """Return J = dL / d(t, w) = [u, (R P) x u], shape (n, 6, 6): three columns [mm/mm], three [mm/rad]."""
    return np.concatenate([struts.unit, np.cross(struts.arm_mm, struts.unit)], axis=2)


@dataclass(frozen=True)
class Response:
    """Sensitivity of one quantity to the machine's errors at given poses.

    Attributes:
        per_parameter: struts, then x, y, z of base joints in machine axes, shape (n, 24) [unit/mm].
        direction: sensitivity to shifts of the tool ball, machine axes, shape (n, 3) [unit/mm].
        rotation: of the platform, shape (n, 3, 3).
    """

    per_parameter: Floats
    direction: Floats
    rotation: Floats

    @property
    def per_strut(self) -> Floats:
        """Return the sensitivity per strut length, shape (n, 6) [unit/mm]."""
        return self.per_parameter[:, :STRUTS]

    @property
    def per_base_joint(self) -> Floats:
        """Return the sensitivity per base joint, machine axes, shape (n, 6, 3) [unit/mm]."""
        return self.per_parameter[:, STRUTS:].reshape(-1, STRUTS, 3)

    @property
    def per_platform_joint(self) -> Floats:
        """Return the sensitivity to platform joints, platform axes, shape (n, 6, 3) [unit/mm]: dP acts as -R dP on the base."""
        return -self.per_base_joint @ self.rotation

    @property
    def per_tool_ball(self) -> Floats:
        """Return the sensitivity to tool tip and ball, platform axes, shape (n, 3) [unit/mm]."""
        return np.einsum("nji,nj->ni", self.rotation, self.direction)


@dataclass(frozen=True)
class BarSensitivity:
    """A bar's length and its derivatives at given poses.

    Attributes:
        length_mm: between ball centres, shape (n,).
        direction: from fixed to moving ball, shape (n, 3) [1]; the derivative by the fixed ball's place is minus this.
        response: of the length [mm/mm].
    """

    length_mm: Floats
    direction: Floats
    response: Response


def bar_sensitivity(
    hexapod: Hexapod,
    frames: Frames,
    fixed_ball_mm: Floats,
    tool_ball_mm: Floats | None = None,
) -> BarSensitivity:
    """Return a bar's length and its exact derivatives by the adjoint method: one 6x6 solution per pose.

    [CAL II-D] computes them numerically, but by the implicit function theorem a strut error dL moves the pose by J^-1
    dL. With bar direction n and J^T g = [n, (R o) x n], the length changes by g dL. Joint errors act as strut errors u
    dQ and -u R dP.

    Args:
        tool_ball_mm: platform frame, shape (3,) or (n, 3); default: the tool tip.

    Raises:
        KinematicsError: the platform can move with locked struts.
    """
    count = len(frames)
    tool = np.zeros(3) if tool_ball_mm is None else tool_ball_mm
    length, direction = np.empty(count), np.empty((count, 3))
    gain = np.empty((count, PARAMETERS))
    outcome = np.empty(count, dtype=np.int64)
    balls = (_balls(fixed_ball_mm, count), _balls(tool, count))
    machine = (frames.position_mm, frames.rotation, *_joints(hexapod, count))
    in_blocks(kernels.bar, count, *machine, *balls, length, direction, gain, outcome)
    failed = outcome != kernels.CONVERGED
    if failed.any():
        _refuse(int(np.argmax(failed)), frames, hexapod, strut_lengths(hexapod, frames), singular=True)
    return BarSensitivity(length, direction, Response(gain, direction, frames.rotation))


def position_responses(hexapod: Hexapod, frames: Frames) -> tuple[Response, Response, Response]:
    """Return sensitivities of the tool tip's X, Y and Z at `frames`."""
    struts = inverse(hexapod, frames)
    pose_per_strut = np.linalg.inv(strut_jacobian(struts))
    count = len(frames)

    def response(axis: int) -> Response:
        gain = pose_per_strut[:, axis, :]
        per_base = (gain[:, :, None] * struts.unit).reshape(count, -1)
        along = np.broadcast_to(np.eye(3)[axis], (count, 3))
        return Response(np.hstack([gain, per_base]), along, frames.rotation)

    return response(0), response(1), response(2)


def _spans(hexapod: Hexapod, frames: Frames) -> tuple[Floats, Floats]:
    """Return T + R P - Q and R P, both (n, 6, 3) [mm]."""
    # NumPy is used because starting the compiler takes half a second.
    base, platform = _joints(hexapod, len(frames))
    if len(platform) == 1:  # one product of two large matrices instead of many small ones
        products = frames.rotation.reshape(-1, 3) @ platform[0].T
        arm = np.swapaxes(products.reshape(-1, 3, STRUTS), 1, 2)
    else:
        arm = platform @ np.swapaxes(frames.rotation, 1, 2)
    return frames.position_mm[:, np.newaxis, :] + arm - base, arm


def _lengths(span: Floats) -> Floats:
    return np.sqrt(np.einsum("nik,nik->ni", span, span))


def _joints(hexapod: Hexapod, count: int) -> tuple[Floats, Floats]:
    """Return joints for kernels: shape (1, 6, 3) or (n, 6, 3), contiguous."""
    base, platform = (
        np.ascontiguousarray(joints if joints.ndim > 2 else joints[None], dtype=np.float64)  # noqa: PLR2004
        for joints in (hexapod.base_joints_mm, hexapod.platform_joints_mm)
    )
    for joints in (base, platform):
        if joints.shape not in {(1, STRUTS, 3), (count, STRUTS, 3)}:
            raise ValueError(f"joints of shape {joints.shape} do not fit {count} poses")
    return base, platform


def _balls(centre_mm: Floats, count: int) -> Floats:
    """Return ball centres for kernels: shape (1, 3) or (n, 3), contiguous."""
    balls = np.ascontiguousarray(np.atleast_2d(centre_mm), dtype=np.float64)
    if balls.shape not in {(1, 3), (count, 3)}:
        raise ValueError(f"ball centres of shape {balls.shape} do not fit {count} poses")
    return balls


def _refuse(
    where: int,
    frames: Frames,
    hexapod: Hexapod,
    length_mm: Floats,
    *,
    singular: bool,
) -> None:
    pose = frames.to_poses(hexapod.rotation)[where]
    lengths = ", ".join(f"{length:.3f}" for length in length_mm[where])
    why = "the platform is loose there (singular pose)" if singular else "no pose has these strut lengths"
    raise KinematicsError(
        f"{why}: struts {lengths} mm, searched from X {pose[0]:.3f} Y {pose[1]:.3f} Z {pose[2]:.3f} mm "
        f"A {pose[3]:.4f} B {pose[4]:.4f} C {pose[5]:.4f} deg",
        where=f"pose {where + 1}",
        remedy="check the machine file's joints and the commanded pose",
    )
