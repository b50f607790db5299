"""Limits of axes, tilt angles and struts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TravelError
from dbbstation.machine.compiled import compiled, inlined
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.rotation import Frames

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.machine.kinematics import Struts

ROUNDING = 1e-9
"""Tolerance for rounding: a pose exactly on the limit is inside [mm or deg]."""


LEAST_STIFFNESS = 0.02
"""Least Jacobian determinant, relative to the middle of the travel. Below it a pose counts as loose: the struts hardly
hold the platform in some direction. On a PM-600-like machine the determinant passes through zero at high tilt near the
upper limit."""


SMALLER = "move the circle, make it smaller or tilt it less"
"""Remedy for poses outside the travel."""


def check_travel(machine: Machine, poses: Floats, *, where: str, remedy: str = SMALLER) -> None:
    """Refuse poses, shape (n, 6) [mm, deg], outside the nominal travel.

    Raises:
        TravelError: names `where`, the first pose outside, and the limit that it exceeds most.
    """
    quantities = _limited_quantities(machine, poses)
    excess = np.stack([np.maximum(low - value, value - high) for _, _, value, low, high in quantities])
    # NaN is also outside.
    outside = ~(excess <= ROUNDING)
    if not outside.any():
        return
    pose_number = int(np.argmax(outside.any(axis=0)))
    worst = int(np.argmax(np.where(np.isnan(excess[:, pose_number]), np.inf, excess[:, pose_number])))
    name, unit, value, low, high = quantities[worst]
    pose = " ".join(f"{axis} {coordinate:.3f}" for axis, coordinate in zip("XYZABC", poses[pose_number], strict=True))
    raise TravelError(
        f"{name} is {value[pose_number]:.3f} {unit}, its travel {low:g} to {high:g} {unit} (at {pose})",
        where=where if len(poses) == 1 else f"{where}, pose {pose_number + 1} of {len(poses)}",
        remedy=remedy,
    )


def middle(machine: Machine) -> Frames:
    """Return the pose in the middle of the travel: on the Z axis, at mid-height, untilted."""
    height = sum(machine.travel.z_mm) / 2.0
    return Frames.from_poses(np.array([[0.0, 0.0, height, 0.0, 0.0, 0.0]]), machine.hexapod.rotation)


def _limited_quantities(
    machine: Machine,
    poses: Floats,
) -> list[tuple[str, str, Floats, float, float]]:
    travel = machine.travel
    radius = np.hypot(poses[:, 0], poses[:, 1])
    struts = inverse(machine.hexapod, Frames.from_poses(poses, machine.hexapod.rotation))
    driven = struts.length_mm - machine.reference_length_error_mm
    return [
        ("the hold of the struts on the platform", "of the middle's", _hold(machine, struts), LEAST_STIFFNESS, np.inf),
        ("the distance from the Z axis", "mm", radius, 0.0, travel.xy_radius_mm),
        ("X", "mm", poses[:, 0], *travel.x_mm),
        ("Y", "mm", poses[:, 1], *travel.y_mm),
        ("Z", "mm", poses[:, 2], *travel.z_mm),
        ("A", "deg", poses[:, 3], *travel.a_deg),
        ("B", "deg", poses[:, 4], *travel.b_deg),
        ("C", "deg", poses[:, 5], *travel.c_deg),
        *((f"strut {i + 1}", "mm", driven[:, i], *travel.strut_mm) for i in range(STRUTS)),
    ]


def _hold(machine: Machine, struts: Struts) -> Floats:
    there = inverse(machine.hexapod, middle(machine))
    return _determinants(struts.unit, struts.arm_mm) / _determinants(there.unit, there.arm_mm)


@compiled
def _determinants(unit: Floats, arm: Floats) -> Floats:
    """Return determinants of strut Jacobians, shape (n,): five times as quick as NumPy's."""
    found = np.empty(len(unit))
    rows = np.empty((STRUTS, STRUTS))
    for pose in range(len(unit)):
        for strut in range(STRUTS):
            ux, uy, uz = unit[pose, strut]
            ax, ay, az = arm[pose, strut]
            rows[strut, 0], rows[strut, 1], rows[strut, 2] = ux, uy, uz
            rows[strut, 3], rows[strut, 4], rows[strut, 5] = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
        found[pose] = _eliminated(rows)
    return found


@inlined
def _eliminated(rows: Floats) -> float:
    """Return the determinant of a matrix, shape (6, 6), by elimination in place with the largest pivots."""
    product = 1.0
    for column in range(STRUTS):
        best = column
        for row in range(column + 1, STRUTS):
            best = row if abs(rows[row, column]) > abs(rows[best, column]) else best
        pivot = rows[best, column]
        if pivot == 0.0:
            return 0.0
        product *= pivot if best == column else -pivot
        for k in range(column, STRUTS):
            rows[best, k], rows[column, k] = rows[column, k], rows[best, k]
        for row in range(column + 1, STRUTS):
            share = rows[row, column] / pivot
            for k in range(column + 1, STRUTS):
                rows[row, k] -= share * rows[column, k]
    return product
