"""Joints that are no points, joints that turn screws, struts that sag: against chains of bodies and a beam."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation as Turn

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames, JointAxes, Rotation
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.travel import middle
from dbbstation.sources.causes.joint_runout import JointRunout
from dbbstation.sources.causes.strut_bending import StrutBending
from dbbstation.sources.causes.ujoint_screw import UjointScrew
from dbbstation.sources.contract import Motion
from tests.sources.runs import concealed_share, jig_runs, random_machine, random_run

RUNOUT, SCREW, SAG = JointRunout(), UjointScrew(), StrutBending()


@pytest.fixture(params=list(Rotation))
def machine(request, reference, rng):
    return random_machine(reference, request.param, rng)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def struts_at(machine, frames):
    """Base joints, platform joints in machine axes and platform rotation, one row per pose."""
    ends = frames.position_mm[:, None] + np.einsum("nij,kj->nki", frames.rotation, machine.hexapod.platform_joints_mm)
    return machine.hexapod.base_joints_mm, ends, frames.rotation


def across_the_strut(machine, rng):
    rest = inverse(machine.hexapod, middle(machine)).unit[0]
    return (unit(np.cross(rest, rng.normal(size=(6, 3)))) for _ in range(2))


def offsets(axes_base, axes_platform, machine, offset_um):
    """Offsets as parameters: e a_v², e a_h², e a_v a_h, with v in the strut's vertical plane and h level; no cranks."""
    rest = inverse(machine.hexapod, middle(machine)).unit[0]
    level = unit(np.cross(rest, [0.0, 0.0, 1.0]))
    up = np.cross(level, rest)
    sizes = np.zeros((6, 8))
    for k, (axes, e) in enumerate(zip((axes_base, axes_platform), offset_um, strict=True)):
        v, h = np.sum(axes * up, axis=1), np.sum(axes * level, axis=1)
        sizes[:, 3 * k : 3 * k + 3] = e * np.column_stack([v**2, h**2, v * h])
    return sizes.ravel()


@pytest.mark.parametrize("offset_um", [(25.0, 0.0), (0.0, -18.0), (12.0, 30.0)])
def test_axes_that_do_not_meet_in_a_chain_of_bodies(machine, rng, offset_um):
    axes_base, axes_platform = across_the_strut(machine, rng)

    def between_second_axes(frames):
        base, ends, turned = struts_at(machine, frames)
        along = unit(ends - base)
        fixed = np.broadcast_to(axes_base, along.shape)
        moving = np.einsum("nij,kj->nki", turned, axes_platform)

        def towards(axes, direction):
            return unit(direction - axes * np.sum(axes * direction, axis=-1, keepdims=True))

        upper = base + 1e-3 * offset_um[0] * towards(fixed, along)
        lower = ends - 1e-3 * offset_um[1] * towards(moving, along)
        return np.linalg.norm(lower - upper, axis=2)

    motion = random_run(rng, 80)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    distance = [np.linalg.norm(e - b, axis=2) for b, e, _ in (struts_at(machine, f) for f in (frames, middle(machine)))]
    # The drive sets the part between the second axes; the joints are further apart by what is left, less at rest.
    longer = distance[0] - between_second_axes(frames) - (distance[1] - between_second_axes(middle(machine)))
    error = RUNOUT.effect(motion, machine, offsets(axes_base, axes_platform, machine, offset_um)).strut_mm
    assert np.abs(longer).max() > 2e-5
    # The model is of second order in the swing.
    assert np.allclose(error, longer, atol=0.03 * np.abs(longer).max())


def test_a_crank_in_the_platform_is_a_joint_in_another_place(machine, rng):
    """Two numbers across each strut lengthen it as exact distances to moved joints do, less what they do at rest."""
    rest = inverse(machine.hexapod, middle(machine)).unit[0]
    level = unit(np.cross(rest, [0.0, 0.0, 1.0]))
    up = np.cross(level, rest)
    across_um = rng.normal(scale=20.0, size=(6, 2))
    moved_mm = 1e-3 * (across_um[:, :1] * up + across_um[:, 1:] * level)
    motion = random_run(rng, 80)

    def longer(frames):
        base, ends, turned = struts_at(machine, frames)
        by_move = np.einsum("nij,kj->nki", turned, moved_mm)
        return np.linalg.norm(ends + by_move - base, axis=2) - np.linalg.norm(ends - base, axis=2)

    wanted = longer(Frames.from_poses(motion.poses, machine.hexapod.rotation)) - longer(middle(machine))
    values = np.zeros((6, 8))
    values[:, 6:] = across_um
    assert np.abs(wanted).max() > 2e-3
    assert np.allclose(RUNOUT.effect(motion, machine, values.ravel()).strut_mm, wanted, atol=1e-5)


def test_three_numbers_of_a_joint_are_an_oval_ball(machine, rng):
    """A radius u S u in the platform, less what is a shift of the joint or a length; S may lean by 3 degrees.

    Where S leans against the strut more, terms of third order in the swing come in.
    """
    motion = random_run(rng)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    direction = np.einsum("nji,nkj->nki", frames.rotation, inverse(machine.hexapod, frames).unit)[:, 3]
    rest = inverse(machine.hexapod, middle(machine)).unit[0, 3]
    frame = np.linalg.qr(np.column_stack([rest, rng.normal(size=(3, 2))]))[0]
    by_offset = 1e3 * RUNOUT.derivative(motion, machine, np.zeros(48)).strut_mm[:, 3, 27:30]
    known = np.column_stack([by_offset, direction, np.ones(len(direction))])
    for lean_deg, allowed in ((0.0, 1e-9), (3.0, 0.02)):
        axes = Turn.from_rotvec(np.radians(lean_deg) * frame[:, 1]).as_matrix() @ frame
        radius = np.einsum("ni,ij,nj->n", direction, axes @ np.diag(rng.normal(size=3)) @ axes.T, direction)
        shift = np.column_stack([direction, np.ones(len(direction))])
        form = radius - shift @ np.linalg.lstsq(shift, radius, rcond=None)[0]
        left = radius - known @ np.linalg.lstsq(known, radius, rcond=None)[0]
        assert np.abs(left).max() < allowed * np.ptp(form)


def twist_by_bodies(axis_base, axis_platform, turned, rest, now):
    """Turn of the lower part of a strut against the upper one about the strut, from the rotations of both bodies.

    A body hangs in a joint: turned about the first axis, then about its own second one, until it points along `now`.
    """

    def body(first):
        second = unit(np.cross(first, rest))

        def pose(angles):
            return Turn.from_rotvec(angles[0] * first) * Turn.from_rotvec(angles[1] * second)

        target = now if first is axis_base else turned.T @ now
        angles = least_squares(
            lambda x: pose(x).apply(rest) - target, np.zeros(2), xtol=1e-15, ftol=1e-15, gtol=1e-15
        ).x
        return pose(angles)

    upper, lower = body(axis_base), Turn.from_matrix(turned) * body(axis_platform)
    return float((upper.inv() * lower).as_rotvec() @ rest)


def test_nut_and_screw_turn_as_two_bodies_in_their_joints(machine, rng):
    axes_base, axes_platform = (unit(a + 0.2 * rng.normal(size=(6, 3))) for a in across_the_strut(machine, rng))
    fitted = replace(machine, joint_axes=JointAxes(axes_base, axes_platform * 1.003))
    motion = random_run(rng, 12)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    base, ends, turned = struts_at(machine, frames)
    now, rest = unit(ends - base), inverse(machine.hexapod, middle(machine)).unit[0]
    expected = [
        [twist_by_bodies(axes_base[i], axes_platform[i], turned[n], rest[i], now[n, i]) for i in range(6)]
        for n in range(12)
    ]
    travel = SCREW.effect(motion, fitted, np.array([10.0])).strut_mm
    assert np.ptp(travel) > 0.05
    assert np.allclose(travel, 10.0 * np.array(expected) / (2 * np.pi), atol=1e-7)


def test_a_platform_that_only_travels_turns_no_screw_whose_axes_are_parallel(reference, rng):
    axes = rng.normal(size=(6, 3))
    fitted = replace(reference, joint_axes=JointAxes(axes, axes))
    poses = random_run(rng).poses * [1, 1, 1, 0, 0, 0]
    assert np.allclose(SCREW.effect(Motion(poses), fitted, np.array([10.0])).strut_mm, 0.0, atol=1e-12)


def test_what_the_joints_source_lacks_is_said_by_name(reference):
    with pytest.raises(ModelError, match=r"ujoint-screw needs the directions .* has no `joint_axes`; add `joint_axes:"):
        SCREW.parameters(reference)
    axes = np.tile([1.0, 0.0, 0.0], (6, 1))
    with pytest.raises(ModelError, match="ujoint-screw needs the lead"):
        SCREW.parameters(replace(reference, screw_lead_mm=None, joint_axes=JointAxes(axes, axes)))
    along = axes.copy()
    along[3] = inverse(reference.hexapod, middle(reference)).unit[0, 3]
    with pytest.raises(ModelError, match="axis of the platform joint of strut 4 lies along the strut at pose 1"):
        SCREW.effect(
            Motion(np.zeros((1, 6)) - [0, 0, 1008, 0, 0, 0]),
            replace(reference, joint_axes=JointAxes(axes, along)),
            np.ones(1),
        )


def sagging(mass_kg, length_mm, stiffness_n_mm2, across):
    """Sag and shortening of a beam pinned at its ends, by solving E I w'''' = q [mm]."""
    q = mass_kg * 9.81 * across / length_mm

    def slopes(_, y):
        return np.vstack([y[1], y[2], y[3], np.full(y.shape[1], q / stiffness_n_mm2), y[1] ** 2 / 2])

    def ends(a, b):
        return np.array([a[0], b[0], a[2], b[2], a[4]])

    x = np.linspace(0, length_mm, 41)
    solved = solve_bvp(slopes, ends, x, np.zeros((5, 41)), tol=1e-9)
    assert solved.success
    return solved.sol(length_mm / 2)[0], solved.sol(length_mm)[4]


def test_a_sagging_strut_is_shorter_by_what_its_slope_takes_off(machine, rng):
    """25 kg on a steel bar of 30 mm diameter, at every length and inclination of the poses."""
    stiffness = 210e3 * np.pi * 30.0**4 / 64
    motion = random_run(rng, 4)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    base, ends, _ = struts_at(machine, frames)
    strut = ends - base
    across = np.linalg.norm(np.cross(unit(strut), [0, 0, 1]), axis=2)
    length = np.linalg.norm(strut, axis=2)
    expected = -np.array(
        [[sagging(25.0, length[n, i], stiffness, across[n, i])[1] for i in range(6)] for n in range(4)]
    )
    sag, level = sagging(25.0, 1000.0, stiffness, 1.0)
    assert level == pytest.approx(2.487 * sag**2 / 1000.0, rel=1e-3)
    assert np.allclose(SAG.effect(motion, machine, np.array([1e3 * level])).strut_mm, expected, rtol=1e-5)
    # The usual size that the source declares is that of such a strut.
    assert SAG.parameters(machine)[0].plausible == pytest.approx(1e3 * level, rel=0.25)


def test_a_hanging_strut_does_not_sag(reference):
    plumb = np.column_stack([reference.hexapod.platform_joints_mm[:, :2], np.zeros(6)])
    hanging = replace(reference, hexapod=replace(reference.hexapod, base_joints_mm=plumb))
    assert np.allclose(SAG.effect(Motion(np.array([[0, 0, -1008.0, 0, 0, 0]])), hanging, np.ones(1)).strut_mm, 0.0)


def test_little_of_sag_and_runout_is_left_by_a_kinematic_calibration(reference):
    runs = jig_runs(step_deg=6.0)
    sag = concealed_share(reference, runs, lambda m: SAG.derivative(m, reference, np.zeros(1)))
    runout = concealed_share(reference, runs, lambda m: RUNOUT.derivative(m, reference, np.zeros(48)))
    assert sag[0] > 0.9
    assert (runout > 0.7).all()
