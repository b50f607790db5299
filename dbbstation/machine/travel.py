"""Limits of axes, tilt angles and struts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TravelError
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import inverse, strut_jacobian
from dbbstation.machine.rotation import Frames

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.machine.kinematics import Struts

ROUNDING = 1e-9
"""Tolerance for rounding: a pose exactly on the limit is inside [mm or deg]."""


LEAST_STIFFNESS = 0.02
"""Least Jacobian determinant, relative to the middle of the travel. Below it a pose counts as loose: the struts hardly
hold the platform in some direction. Travel limits alone allow such poses. On a PM-600-like machine the determinant
passes through zero at high tilt near the upper limit."""


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
    with np.errstate(invalid="ignore"):  # a NaN pose counts as loose and is refused
        return np.asarray(np.linalg.det(strut_jacobian(struts)) / np.linalg.det(strut_jacobian(there)))
