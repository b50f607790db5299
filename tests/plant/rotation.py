"""Rotation matrices of the platform in the two conventions that a machine file can name.

`R` turns platform coordinates into machine coordinates. Angles are degrees at the interface.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray

Convention: TypeAlias = Literal["Rx(A) Ry(B) Rz(C)", "Rz(C) Ry(B) Rx(A)"]
CONVENTIONS: tuple[Convention, ...] = get_args(Convention)


def rotation_matrix(angles_deg: FloatArray, convention: Convention) -> FloatArray:
    """Rotation matrices `(n, 3, 3)` of angles A, B, C [deg] `(n, 3)`, written out element by element."""
    angle_rad = np.radians(angles_deg)
    ca, cb, cc = np.cos(angle_rad).T
    sa, sb, sc = np.sin(angle_rad).T
    if convention == "Rx(A) Ry(B) Rz(C)":
        rows = [
            [cb * cc, -cb * sc, sb],
            [ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb],
            [sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb],
        ]
    else:
        rows = [
            [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca],
        ]
    return np.moveaxis(np.array(rows), 2, 0)


def angles_of(rotation: FloatArray, convention: Convention) -> FloatArray:
    """Angles A, B, C [deg] `(n, 3)` of rotation matrices `(n, 3, 3)`; B stays within ±90."""
    if convention == "Rx(A) Ry(B) Rz(C)":
        a_rad = np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2])
        b_rad = np.arctan2(rotation[:, 0, 2], np.hypot(rotation[:, 0, 0], rotation[:, 0, 1]))
        c_rad = np.arctan2(-rotation[:, 0, 1], rotation[:, 0, 0])
    else:
        a_rad = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
        b_rad = np.arctan2(-rotation[:, 2, 0], np.hypot(rotation[:, 0, 0], rotation[:, 1, 0]))
        c_rad = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    return np.degrees(np.stack([a_rad, b_rad, c_rad], axis=1))


def turned(rotation: FloatArray, turn_rad: FloatArray) -> FloatArray:
    """Rotations `(n, 3, 3)` turned further by rotation vectors [rad] `(n, 3)` in the machine frame (Rodrigues)."""
    angle_rad = np.linalg.norm(turn_rad, axis=1)
    # sin(x)/x and (1-cos(x))/x² written with sinc stay exact down to no turn at all.
    first = np.sinc(angle_rad / np.pi)[:, None, None]
    second = 0.5 * (np.sinc(angle_rad / (2 * np.pi)) ** 2)[:, None, None]
    cross = np.zeros((len(turn_rad), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -turn_rad[:, 2], turn_rad[:, 1], -turn_rad[:, 0]
    cross -= cross.transpose(0, 2, 1)
    return rotation + (first * cross + second * (cross @ cross)) @ rotation
