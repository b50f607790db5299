"""Limits of axes, tilt angles and struts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.errors import TravelError
from dbbstation.machine.geometry import STRUTS, Frames, rotation_matrices
from dbbstation.machine.kinematics import inverse, strut_jacobian

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

ROUNDING = 1e-9
"""Tolerance for rounding: a pose exactly on the limit is inside [mm or deg]."""


LEAST_STIFFNESS = 0.02
"""Least Jacobian determinant, relative to the middle of the travel. Below it a pose counts as loose: the struts hardly
hold the platform in some direction. On a PM-600-like machine the determinant passes through zero at high tilt near the
upper limit."""


SMALLER = "move the circle, make it smaller or tilt it less"
"""Remedy for poses outside the travel."""


def is_within_travel(machine: Machine, poses: Floats) -> bool:
    """Return whether all poses, shape (n, 6) [mm, deg], are reachable."""
    return first_outside(machine, poses)[0] == len(poses)


def reachable(machine: Machine, poses: Floats) -> Floats:
    """Return the reachable ones of poses, shape (n, 6) [mm, deg]."""
    found, rest = [poses[:0]], poses
    while len(rest):
        number, _ = first_outside(machine, rest)
        found.append(rest[:number])
        rest = rest[number + 1 :]
    return np.vstack(found)


def check_travel(machine: Machine, poses: Floats, *, where: str, remedy: str = SMALLER) -> None:
    """Refuse poses, shape (n, 6) [mm, deg], outside the nominal travel.

    Raises:
        TravelError: names `where`, the first pose outside, and the limit that it exceeds most.
    """
    number, value = first_outside(machine, poses)
    if number == len(poses):
        return
    limits = _limits(machine)
    low, high = np.array([limit[2:] for limit in limits]).T
    worst = int(np.argmax(np.nan_to_num(np.maximum(low - value, value - high), nan=np.inf)))
    name, unit, *_ = limits[worst]
    pose = " ".join(f"{axis} {coordinate:.3f}" for axis, coordinate in zip("XYZABC", poses[number], strict=True))
    raise TravelError(
        f"{name} is {value[worst]:.3f} {unit}, its travel {low[worst]:g} to {high[worst]:g} {unit} (at {pose})",
        where=where if len(poses) == 1 else f"{where}, pose {number + 1} of {len(poses)}",
        remedy=remedy,
    )


def first_outside(machine: Machine, poses: Floats) -> tuple[int, Floats]:
    """Return the number of the first pose, shape (n, 6) [mm, deg], outside the nominal travel, and its limited quantities; n if all are inside."""
    hexapod = machine.hexapod
    limits = np.array([limit[2:] for limit in _limits(machine)])
    held = np.linalg.det(strut_jacobian(inverse(hexapod, middle(machine))))[0]
    base, platform = (np.ascontiguousarray(each) for each in (hexapod.base_joints_mm, hexapod.platform_joints_mm))
    found = np.empty(len(limits))
    rotation = rotation_matrices(poses[:, 3:], hexapod.rotation)
    error_mm = machine.reference_length_error_mm
    number = _first_outside(np.ascontiguousarray(poses), rotation, base, platform, error_mm, held, limits, found)
    return number, found


def middle(machine: Machine) -> Frames:
    """Return the pose in the middle of the travel: on the Z axis, at mid-height, untilted."""
    height = sum(machine.travel.z_mm) / 2.0
    return Frames.from_poses(np.array([[0.0, 0.0, height, 0.0, 0.0, 0.0]]), machine.hexapod.rotation)


def _limits(machine: Machine) -> list[tuple[str, str, float, float]]:
    travel = machine.travel
    return [
        ("the hold of the struts on the platform", "of the middle's", LEAST_STIFFNESS, np.inf),
        ("the distance from the Z axis", "mm", 0.0, travel.xy_radius_mm),
        ("X", "mm", *travel.x_mm),
        ("Y", "mm", *travel.y_mm),
        ("Z", "mm", *travel.z_mm),
        ("A", "deg", *travel.a_deg),
        ("B", "deg", *travel.b_deg),
        ("C", "deg", *travel.c_deg),
        *((f"strut {i + 1}", "mm", *travel.strut_mm) for i in range(STRUTS)),
    ]


@compiled
def _first_outside(
    poses: Floats,
    rotation: Floats,
    base: Floats,
    platform: Floats,
    error_mm: Floats,
    held: float,
    limits: Floats,
    found: Floats,
) -> int:
    """Fill `found` with the quantities of successive poses in the order of `_limits`; return the first pose outside."""
    rows = np.empty((STRUTS, STRUTS))
    for number in range(len(poses)):
        x, y, z = poses[number, :3]
        r = rotation[number]
        for axis in range(6):
            found[2 + axis] = poses[number, axis]
        for strut in range(STRUTS):
            px, py, pz = platform[strut]
            ax = r[0, 0] * px + r[0, 1] * py + r[0, 2] * pz
            ay = r[1, 0] * px + r[1, 1] * py + r[1, 2] * pz
            az = r[2, 0] * px + r[2, 1] * py + r[2, 2] * pz
            ux, uy, uz = x + ax - base[strut, 0], y + ay - base[strut, 1], z + az - base[strut, 2]
            length = np.sqrt(ux * ux + uy * uy + uz * uz)
            found[8 + strut] = length - error_mm[strut]
            ux, uy, uz = ux / length, uy / length, uz / length
            rows[strut, 0], rows[strut, 1], rows[strut, 2] = ux, uy, uz
            rows[strut, 3], rows[strut, 4], rows[strut, 5] = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
        found[0], found[1] = _eliminated(rows) / held, np.hypot(x, y)
        for k in range(len(found)):
            # NaN is also outside.
            if not limits[k, 0] - ROUNDING <= found[k] <= limits[k, 1] + ROUNDING:
                return number
    return len(poses)


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
