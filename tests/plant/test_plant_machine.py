"""The plant's geometry against closed forms, rotations built another way, and a general root finder."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from tests.plant.hexapod import strut_lengths
from tests.plant.machine import random_machine, reference_machine
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import Plan
from tests.plant.rotation import CONVENTIONS, Convention, angles_of, rotation_matrix, turned
from tests.plant.run import Motion, Scene
from tests.plant.simulate import true_platform

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.base import Mechanism

EMPTY = Plan((), ())


def some_poses(count: int, seed: int = 1) -> FloatArray:
    rng = np.random.default_rng(seed)
    position_mm = rng.uniform([-200, -200, -1150], [200, 200, -850], (count, 3))
    return np.concatenate([position_mm, rng.uniform(-15, 15, (count, 3))], axis=1)


def still(machine: Machine, poses: FloatArray) -> Motion:
    return Motion(Scene(machine, EMPTY, ()), np.zeros(len(poses)), poses)


@pytest.mark.parametrize(("convention", "sequence"), [(CONVENTIONS[0], "XYZ"), (CONVENTIONS[1], "ZYX")])
def test_rotations_are_the_product_that_the_convention_names(convention: Convention, sequence: str) -> None:
    angles_deg = np.random.default_rng(0).uniform(-40, 40, (20, 3))
    ordered = angles_deg if sequence == "XYZ" else angles_deg[:, ::-1]
    # Upper case asks SciPy for turns about the moving axes: the factors of the product from left to right.
    expected = Rotation.from_euler(sequence, ordered, degrees=True).as_matrix()
    np.testing.assert_allclose(rotation_matrix(angles_deg, convention), expected, atol=1e-15)
    np.testing.assert_allclose(angles_of(expected, convention), angles_deg, atol=1e-12)


def test_a_rotation_vector_turns_by_its_length() -> None:
    vectors = np.random.default_rng(3).uniform(-1, 1, (10, 3))
    start = np.broadcast_to(np.eye(3), (10, 3, 3))
    np.testing.assert_allclose(turned(start, vectors), Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)
    np.testing.assert_array_equal(turned(start, np.zeros((10, 3))), start)


def test_the_reference_machine_has_threefold_symmetry() -> None:
    machine = reference_machine()
    third = Rotation.from_euler("z", 120, degrees=True).as_matrix()
    for joints_mm in (machine.base_joints_mm, machine.platform_joints_mm):
        np.testing.assert_allclose(np.roll(joints_mm, -2, axis=0)[[0, 2, 4]], joints_mm[[0, 2, 4]] @ third.T, atol=1e-9)
    length_mm = strut_lengths(machine, np.array([[0.0, 0, -1008, 0, 0, 0]]))
    # Law of cosines across the 45 degrees between the joints of a strut, and 508 mm of height.
    flat_mm2 = 735**2 + 395**2 - 2 * 735 * 395 * np.cos(np.radians(45))
    np.testing.assert_allclose(length_mm, np.sqrt(flat_mm2 + 508**2), rtol=1e-12)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_true_pose_solves_the_strut_equations_of_the_true_machine(convention: Convention) -> None:
    machine = random_machine(4, rotation=convention)
    rng = np.random.default_rng(5)
    errors = Kinematics(*(0.1 * rng.standard_normal(shape) for shape in (6, (6, 3), (6, 3))))
    poses = some_poses(4)
    platform = true_platform(still(machine, poses), [errors])
    found = np.concatenate([platform.position_mm, angles_of(platform.rotation, convention)], axis=1)
    real = replace(
        machine,
        base_joints_mm=machine.base_joints_mm + errors.base_mm,
        platform_joints_mm=machine.platform_joints_mm + errors.platform_mm,
    )
    for pose, commanded in zip(found, poses, strict=True):
        wanted_mm = strut_lengths(machine, commanded[None])[0] + errors.length_mm

        def missing_mm(trial: FloatArray, wanted_mm: FloatArray = wanted_mm) -> FloatArray:
            return strut_lengths(real, trial[None])[0] - wanted_mm

        np.testing.assert_allclose(pose, fsolve(missing_mm, commanded, xtol=1e-13), atol=1e-8)


def test_a_machine_without_errors_goes_where_it_is_told() -> None:
    poses = some_poses(50)
    platform = true_platform(still(reference_machine(), poses), [])
    np.testing.assert_allclose(platform.position_mm, poses[:, :3], atol=1e-8)


def test_a_reference_length_error_known_to_the_controller_does_no_harm() -> None:
    known_mm = np.array([0.2, -0.1, 0.05, 0.0, 0.3, -0.25])
    machine = replace(reference_machine(), reference_length_error_mm=known_mm)
    poses = some_poses(20)
    right = true_platform(still(machine, poses), [Kinematics(length_mm=known_mm)])
    np.testing.assert_allclose(right.position_mm, poses[:, :3], atol=1e-8)


@pytest.mark.parametrize("way", range(3))
def test_moving_all_base_joints_moves_the_platform_along(way: int) -> None:
    shift_mm = np.eye(3)[way] * 0.3
    poses = some_poses(20)
    platform = true_platform(still(reference_machine(), poses), [Kinematics(base_mm=np.tile(shift_mm, (6, 1)))])
    np.testing.assert_allclose(platform.position_mm - poses[:, :3], np.tile(shift_mm, (20, 1)), atol=1e-8)


def test_moving_all_platform_joints_moves_the_tip_against_them() -> None:
    shift_mm = np.array([0.1, -0.2, 0.15])
    poses = some_poses(20)
    errors: list[Mechanism] = [Kinematics(platform_mm=np.tile(shift_mm, (6, 1)))]
    platform = true_platform(still(reference_machine(), poses), errors)
    expected_mm = poses[:, :3] - rotation_matrix(poses[:, 3:], reference_machine().rotation) @ shift_mm
    np.testing.assert_allclose(platform.position_mm, expected_mm, atol=1e-8)


def test_random_machines_differ_by_no_more_than_asked() -> None:
    one, other = random_machine(1, spread_mm=2.0), random_machine(2, spread_mm=2.0)
    assert not np.allclose(one.base_joints_mm, other.base_joints_mm, atol=0.1)
    for machine in (one, other):
        assert np.abs(machine.base_joints_mm - reference_machine().base_joints_mm).max() < 2.0
        assert np.abs(machine.platform_joints_mm - reference_machine().platform_joints_mm).max() < 2.0
