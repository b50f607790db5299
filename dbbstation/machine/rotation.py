"""Frames, and two conventions of the tilt angles A, B, C."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats


class Rotation(StrEnum):
    """Conventions by which A, B and C give R, from platform to machine vectors."""

    XYZ = "Rx(A) Ry(B) Rz(C)"
    ZYX = "Rz(C) Ry(B) Rx(A)"
    """The convention of LinuxCNC's `genhexkins`."""


@dataclass(frozen=True)
class Frames:
    """Poses as position and rotation matrix.

    Attributes:
        position_mm: tool tip, machine frame, shape (n, 3).
        rotation: platform axes in the machine frame, shape (n, 3, 3) [1].
    """

    position_mm: Floats
    rotation: Floats

    def __len__(self) -> int:
        return len(self.position_mm)

    @classmethod
    def from_poses(cls, poses: Floats, convention: Rotation) -> Frames:
        """Return frames of poses `[X, Y, Z, A, B, C]`, shape (n, 6) [mm, deg]."""
        return cls(np.ascontiguousarray(poses[:, :3]), rotation_matrices(poses[:, 3:], convention))

    def to_poses(self, convention: Rotation) -> Floats:
        """Return poses `[X, Y, Z, A, B, C]`, shape (n, 6) [mm, deg]; A and C within ±180, B within ±90 degrees."""
        return np.hstack([self.position_mm, tilt_angles(self.rotation, convention)])


def rotation_matrices(tilt_deg: Floats, convention: Rotation) -> Floats:
    """Return rotation matrices, shape (n, 3, 3), of A, B, C, shape (n, 3) [deg]."""
    # Rz(C) Ry(B) Rx(A) is the transpose of Rx(-A) Ry(-B) Rz(-C), so one product serves both conventions.
    sign = 1.0 if convention is Rotation.XYZ else -1.0
    tilt = np.radians(tilt_deg)
    cos_a, cos_b, cos_c = np.cos(tilt).T
    sin_a, sin_b, sin_c = sign * np.sin(tilt).T
    matrix = np.empty((len(tilt), 3, 3))
    product = matrix if convention is Rotation.XYZ else np.swapaxes(matrix, 1, 2)
    product[:, 0, 0] = cos_b * cos_c
    product[:, 0, 1] = -cos_b * sin_c
    product[:, 0, 2] = sin_b
    product[:, 1, 0] = cos_a * sin_c + sin_a * sin_b * cos_c
    product[:, 1, 1] = cos_a * cos_c - sin_a * sin_b * sin_c
    product[:, 1, 2] = -sin_a * cos_b
    product[:, 2, 0] = sin_a * sin_c - cos_a * sin_b * cos_c
    product[:, 2, 1] = sin_a * cos_c + cos_a * sin_b * sin_c
    product[:, 2, 2] = cos_a * cos_b
    return matrix


def tilt_angles(rotation: Floats, convention: Rotation) -> Floats:
    """Return A, B, C, shape (n, 3) [deg], of rotation matrices, shape (n, 3, 3)."""
    # Rx Ry Rz is the transpose of Rz(-C) Ry(-B) Rx(-A), so one extraction serves both conventions.
    sign = -1.0 if convention is Rotation.XYZ else 1.0
    r = np.swapaxes(rotation, 1, 2) if convention is Rotation.XYZ else rotation
    a = np.arctan2(r[:, 2, 1], r[:, 2, 2])
    b = np.arctan2(-r[:, 2, 0], np.hypot(r[:, 2, 1], r[:, 2, 2]))
    c = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    return sign * np.degrees(np.column_stack([a, b, c]))
