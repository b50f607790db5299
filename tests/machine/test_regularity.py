"""A joint that was mistyped in a nominal machine is found; machines of other kinds are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError, StationError
from dbbstation.machine.geometry import Machine, check_joints
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.registry import dialect_named
from dbbstation.nc.rs274.reader import read_program


def changed(machine: Machine, key: str, by_mm: np.ndarray) -> Machine:
    return replace(machine, hexapod=replace(machine.hexapod, **{key: getattr(machine.hexapod, key) + by_mm}))


@pytest.mark.parametrize("key", ["base_joints_mm", "platform_joints_mm"])
@pytest.mark.parametrize("strut", range(6))
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("by_mm", [100.0, -100.0, 12.0])
def test_a_mistyped_joint_is_named(reference, key, strut, axis, by_mm):
    off = np.zeros((6, 3))
    off[strut, axis] = by_mm
    if axis == 2 and by_mm == 12.0:
        check_joints(changed(reference, key, off))  # hardly changes the sides: it stays below a millimetre
        return
    with pytest.raises(ModelError, match=rf"{key}: the joint of strut {strut + 1} is {abs(by_mm):.1f} mm from where"):
        check_joints(changed(reference, key, off))


def test_machines_of_another_kind_are_left_alone(reference, rng):
    check_joints(reference)
    check_joints(changed(reference, "base_joints_mm", rng.normal(0.0, 0.5, (6, 3))))
    check_joints(changed(reference, "base_joints_mm", np.array([[0.0, 0.0, 80.0], [0.0, 0.0, 0.0]] * 3)))
    check_joints(changed(reference, "base_joints_mm", np.array([5.0, 7.0, -900.0])))
    drawn = rng.uniform(-500.0, 500.0, (6, 3))
    check_joints(changed(reference, "base_joints_mm", drawn))
    order = [0, 1, 3, 2, 4, 5]
    hexapod = replace(reference.hexapod, base_joints_mm=reference.hexapod.base_joints_mm[order])
    check_joints(replace(reference, hexapod=hexapod))


def test_no_program_is_compensated_with_a_mistyped_joint(reference):
    off = np.zeros((6, 3))
    off[3, 0] = 100.0
    path = read_program("G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X20 F500\nM2\n", "part.ngc")
    compensated_program(path, dialect_named("linuxcnc"), Inverse(MachineModel(reference, ())))
    with pytest.raises(StationError, match=r"the joint of strut 4 is 100\.0 mm from where"):
        compensated_program(
            path, dialect_named("linuxcnc"), Inverse(MachineModel(changed(reference, "base_joints_mm", off), ()))
        )
