"""Joints that rub, run out or turn the screw, against turns made by hand."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests.plant.hexapod import Platform, commanded_platform
from tests.plant.machine import reference_machine
from tests.plant.mechanisms.joints import (
    HOME,
    JointFriction,
    JointRunout,
    UjointScrew,
    joint_angles_rad,
    joint_axes,
)
from tests.plant.test_plant_machine import still

MACHINE = reference_machine()


def test_joint_angles_are_those_about_the_two_axes() -> None:
    first, second = joint_axes(MACHINE)
    home = commanded_platform(MACHINE, HOME).direction[0]
    swung = []
    for strut in range(6):
        outer = Rotation.from_rotvec(0.2 * first[strut])
        inner = Rotation.from_rotvec(-0.1 * second[strut])
        swung.append((outer * inner).apply(home[strut]))
    np.testing.assert_allclose(
        joint_angles_rad(MACHINE, np.array([swung]))[0], np.tile([0.2, -0.1], (6, 1)), atol=1e-12
    )


def test_runout_goes_round_with_the_first_axis() -> None:
    poses = HOME + np.array([[80.0, -40.0, 60.0, 0, 0, 0]])
    platform = commanded_platform(MACHINE, poses)
    eccentricity_um = np.random.default_rng(1).uniform(-10, 10, (6, 3))
    shift_mm = JointRunout(eccentricity_um).base_shift_mm(still(MACHINE, poses), platform)[0]
    turns_rad = joint_angles_rad(MACHINE, platform.direction)[0, :, 0]
    for strut in range(6):
        turn = Rotation.from_rotvec(turns_rad[strut] * joint_axes(MACHINE)[0][strut])
        expected_mm = (turn.apply(eccentricity_um[strut]) - eccentricity_um[strut]) / 1000.0
        np.testing.assert_allclose(shift_mm[strut], expected_mm, atol=1e-12)


def test_turning_the_platform_about_a_strut_screws_it_out() -> None:
    home = commanded_platform(MACHINE, HOME)
    strut, turn_rad = 2, 0.05
    turn = Rotation.from_rotvec(turn_rad * home.direction[0, strut])
    # About the strut's own axis, so that this strut neither swings nor grows.
    joint_mm = home.position_mm[0] + home.arm_mm[0, strut]
    position_mm = joint_mm + turn.apply(home.position_mm[0] - joint_mm)
    turned = Platform(
        position_mm[None],
        (turn.as_matrix() @ home.rotation[0])[None],
        home.base_mm,
        MACHINE.platform_joints_mm[None],
        MACHINE,
    )
    longer_mm = UjointScrew(share=1.0).lengthening_mm(still(MACHINE, HOME), turned)[0, strut]
    np.testing.assert_allclose(longer_mm, 10.0 * turn_rad / (2 * np.pi), rtol=1e-12)


def test_joint_friction_turns_over_where_a_joint_turns_round() -> None:
    there = np.linspace(0.0, 60.0, 61)
    way_mm = np.concatenate([there, there[::-1]])
    poses = np.tile(HOME, (len(way_mm), 1))
    poses[:, 0] += way_mm
    motion = still(MACHINE, poses)
    stretch_um = 1000.0 * JointFriction().lengthening_mm(motion, commanded_platform(MACHINE, poses))
    out, back = stretch_um[:61], stretch_um[61:][::-1]
    # Fully wound up both ways, the same place is passed with opposite friction.
    np.testing.assert_allclose(out[5:56], -back[5:56], atol=1e-9)
    assert np.abs(out[5:56]).max() > 0.1
    # Friction holds the platform back: against +X, on the average of the struts, on the way out.
    platform = commanded_platform(MACHINE, poses)
    move_mm = np.linalg.solve(platform.jacobian[30], stretch_um[30])
    assert move_mm[0] < 0.0
