"""Check that joints are consistent: every second joint is rotated by 120 degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

REGULAR_MM = 0.05
"""Sides of an equilateral design, written with one decimal, agree within this [mm]. Three joints of another design,
half a metre apart, agree by chance once in (500 / 0.05)², a hundred million."""

OFF_MM = 1.0
"""Rounding cannot make sides differ by more [mm]."""


def check_joints(machine: Machine) -> None:
    """Refuse a machine if three of its joints are regular and the other three are not.

    Machines with all joints regular, or all irregular, are accepted.

    Raises:
        ModelError: names the joint, or its triplet, and the deviation.
    """
    for key in ("base_joints_mm", "platform_joints_mm"):
        joints = np.asarray(getattr(machine.hexapod, key))
        for one, other in (((0, 2, 4), (1, 3, 5)), ((1, 3, 5), (0, 2, 4))):
            sides = _sides_mm(joints[list(other)])
            if np.ptp(_sides_mm(joints[list(one)])) <= REGULAR_MM and np.ptp(sides) > OFF_MM:
                raise ModelError(
                    f"{key}: {_which(joints, one, other)}, while those of struts "
                    f"{', '.join(str(strut + 1) for strut in one)} are exactly regular",
                    where=machine.name,
                    remedy="correct the joint in the model file's `machine`, or calibrate again with the right machine file",
                )


def _which(joints: Floats, regular: tuple[int, ...], other: tuple[int, ...]) -> str:
    centre = joints[list(regular)].mean(axis=0)
    first, second = joints[regular[1]] - joints[regular[0]], joints[regular[2]] - joints[regular[0]]
    axis = np.cross(first, second)
    axis /= np.linalg.norm(axis)
    for place, strut in enumerate(other):
        after, before = other[(place + 1) % 3], other[(place + 2) % 3]
        for turn in (1.0, -1.0):
            expected = _turned(joints[before] - centre, axis, turn) + centre
            again = _turned(joints[after] - centre, axis, -turn) + centre
            if np.linalg.norm(expected - again) <= OFF_MM:
                off_mm = float(np.linalg.norm(joints[strut] - expected))
                return f"the joint of strut {strut + 1} is {off_mm:.1f} mm from where those of the other struts put it"
    sides = ", ".join(f"{side:.1f}" for side in _sides_mm(joints[list(other)]))
    return f"the joints of struts {', '.join(str(strut + 1) for strut in other)} are {sides} mm apart"


def _sides_mm(triangle: Floats) -> Floats:
    sides: Floats = np.linalg.norm(triangle - np.roll(triangle, 1, axis=0), axis=1)
    return sides


def _turned(vector: Floats, axis: Floats, turn: float) -> Floats:
    angle = turn * 2.0 * np.pi / 3.0
    turned: Floats = (
        vector * np.cos(angle) + np.cross(axis, vector) * np.sin(angle) + axis * (axis @ vector) * (1.0 - np.cos(angle))
    )
    return turned
