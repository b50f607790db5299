"""Friction in the base joints: against virtual work, rotations composed of two turns, and a loop in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation as Turn

from dbbstation.errors import ModelError
from dbbstation.laws.play import resistance
from dbbstation.machine.geometry import Compliance, Frames
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.joint_friction import WIND_UP_RAD, JointFriction, friction_drag, outer_axes
from dbbstation.sources.contract import Fitted, Motion
from tests.plant.linear import LinearSession
from tests.plant.mechanisms.joints import JointFriction as FrictionOfPlant
from tests.plant.plan import table_ii_plan
from tests.plant.session import scene_of
from tests.sources.runs import concealed_share, jig_runs, random_machine, random_run, run

FRICTION = JointFriction()
PLACE, TILT = (100, 100, -1150), (-10, 10)
DOWN = np.array([0.0, 0.0, -1.0])


def struts_of(machine, motion):
    return inverse(machine.hexapod, Frames.from_poses(motion.poses, machine.hexapod.rotation))


def platform_joints(machine, frames):
    return frames.position_mm[:, None] + np.einsum("nij,kj->nki", frames.rotation, machine.hexapod.platform_joints_mm)


def two_angles(axis, unit):
    """Angles of a universal joint: a turn about the outer axis, after one about the inner axis, of a strut hung down."""
    inner = np.cross(DOWN, axis)

    def off(q):
        return Turn.from_rotvec(q[0] * axis).apply(Turn.from_rotvec(q[1] * inner).apply(DOWN)) - unit

    return least_squares(off, np.zeros(2), xtol=1e-15, ftol=1e-15, gtol=1e-15).x


def test_the_drag_does_the_work_of_friction_about_two_axes(reference, rng):
    motion = random_run(rng, 4000)
    frames = Frames.from_poses(motion.poses, reference.hexapod.rotation)
    struts, ends = struts_of(reference, motion), platform_joints(reference, frames)
    axes = outer_axes(reference.hexapod)
    drag, _ = friction_drag(struts, axes)
    checked = 0
    for k in range(200, 4000, 400):
        for i in range(6):
            turned = two_angles(axes[i], struts.unit[k + 1, i]) - two_angles(axes[i], struts.unit[k - 1, i])
            # Both angles long past their wind-up.
            past = [two_angles(axes[i], struts.unit[j, i]) for j in (k - 100, k - 50, k)]
            if (np.diff(past, axis=0) * turned < 2 * WIND_UP_RAD * np.abs(turned)).any():
                continue
            work_n_mm = drag[k, i] @ (ends[k + 1, i] - ends[k - 1, i])
            assert work_n_mm == pytest.approx(-1e3 * np.abs(turned).sum(), rel=1e-4)
            checked += 1
    assert checked > 15


def test_tensions_do_the_work_of_the_drag(reference, rng):
    machine = replace(
        random_machine(reference, reference.hexapod.rotation, rng), compliance=Compliance(1e-6, growing_share=0.0)
    )
    motion = random_run(rng, 60)
    struts, frames = struts_of(machine, motion), Frames.from_poses(motion.poses, machine.hexapod.rotation)
    drag, _ = friction_drag(struts, outer_axes(machine.hexapod))
    newton = FRICTION.derivative(motion, machine, np.zeros(6)).strut_mm * 1e6
    for j in range(6):
        h = 1e-2 * np.eye(6)[j]
        ends = [platform_joints(machine, forward(machine.hexapod, struts.length_mm + s * h, frames)) for s in (1, -1)]
        work = np.einsum("nij,nij->ni", drag, (ends[0] - ends[1]) / 2e-2)
        assert np.allclose(newton[:, j], work, rtol=1e-5, atol=1e-6)


def test_friction_follows_a_loop_in_time(rng):
    angle = np.cumsum(rng.normal(0, 3e-5, (2000, 2)), axis=0)
    acts, loop = np.zeros(2), np.zeros_like(angle)
    for k in range(1, len(angle)):
        # An elastic stop: it winds up until the friction holds no more.
        acts = np.clip(acts - 2 * (angle[k] - angle[k - 1]) / WIND_UP_RAD, -1, 1)
        loop[k] = acts
    found, _ = resistance(angle, WIND_UP_RAD)
    after = (np.abs(loop) == 1.0).cumsum(axis=0) > 0
    same = np.abs(found - loop) < 1e-9
    met = np.logical_or.accumulate(same, axis=0)
    assert after[300:].all()
    assert same[300:].all()
    assert met[300:].all()
    assert np.abs(found).max() == pytest.approx(1.0)


def test_steps_sit_where_joints_turn_back_and_not_where_struts_do(reference):
    motion = run(PLACE, TILT, step_deg=0.25, lead_in_deg=90)
    struts = struts_of(reference, motion)
    axes = outer_axes(reference.hexapod)
    apart = []
    for i in range(6):
        unit = struts.unit[:, i]
        # Both angles rise and fall with these.
        swings = [np.arctan2(unit @ np.cross(axes[i], DOWN), unit @ DOWN), unit @ axes[i]]
        turns = np.concatenate([np.flatnonzero(np.diff(np.sign(np.diff(s)))) + 1 for s in swings])
        lengths = np.flatnonzero(np.diff(np.sign(np.diff(struts.length_mm[:, i])))) + 1
        assert len(turns) in {4, 5, 6}
        step = np.abs(np.diff(FRICTION.derivative(motion, reference, np.zeros(6)).strut_mm[:, :, i], axis=0)).max(
            axis=1
        )
        steep = np.flatnonzero(step > 0.15 * step.max())
        behind = steep[:, None] - turns
        assert (np.where(behind >= -2, behind, 1000).min(axis=1) < 16).all()
        apart += list(np.abs(lengths[:, None] - turns).min(axis=1))
    assert np.median(apart) > 20


def test_it_turns_its_sign_with_the_direction(reference):
    there, back = (run(PLACE, TILT, clockwise=c, step_deg=1.0, lead_in_deg=90) for c in (False, True))
    nominal, actual = (MachineModel(reference, fitted) for fitted in ((), (Fitted(FRICTION, np.full(6, 10.0)),)))
    ccw, cw = (1e3 * (actual.bar(m).length_mm - nominal.bar(m).length_mm) for m in (there, back))
    cw = np.roll(cw[::-1], 1)
    assert np.ptp(ccw) > 0.2
    assert np.median(np.abs(ccw + cw)) < 0.02 * np.abs(ccw - cw).max()


def test_no_kinematic_parameter_can_take_it(reference):
    share = concealed_share(reference, jig_runs(4.0), lambda m: FRICTION.derivative(m, reference, np.zeros(6)))
    assert (share < 0.002).all()


def test_a_plumb_strut_has_a_joint_too(reference):
    upright = reference.hexapod
    plumb = upright.platform_joints_mm.copy()
    plumb[0, :2] = upright.base_joints_mm[0, :2]
    axes = outer_axes(replace(upright, platform_joints_mm=plumb))
    assert np.allclose(np.linalg.norm(axes, axis=1), 1)
    assert not axes[:, 2].any()


def test_it_is_compensated(reference):
    model = MachineModel(reference, (Fitted(FRICTION, np.array([30.0, 10.0, -20.0, 40.0, 10.0, 25.0])),))
    wanted = replace(run(PLACE, TILT, step_deg=0.5), kept=slice(None))
    commanded = compensated(model, wanted)
    assert np.abs(commanded - wanted.poses)[:, :3].max() > 5e-4
    assert np.allclose(
        model.actual_poses(replace(wanted, poses=commanded, straight=True)), wanted.poses, rtol=0, atol=1e-8
    )


def test_single_poses_are_refused(reference, rng):
    with pytest.raises(ModelError, match="joint-friction needs path"):
        FRICTION.effect(replace(random_run(rng), is_path=False), reference, np.ones(6))


def test_what_is_left_open_holds_the_joints_of_the_independent_plant(reference):
    session = LinearSession(scene_of(table_ii_plan()))
    for strut in range(6):
        shares = np.eye(6)[strut]
        plant = FrictionOfPlant(1e4, 80.0, shares=tuple(shares))
        readings, law, left_open = [], [], []
        for course in session.courses:
            motion, by_strut = Motion(poses=course.motion.commanded, is_path=True), course.struts[course.kept]
            effect = FRICTION.effect(motion, reference, 10.0 * shares).strut_mm
            others = FRICTION.left_open(motion, reference, 10.0 * shares).strut_mm
            columns = np.einsum("ni,nip->np", by_strut, np.dstack([effect, others])[course.kept])
            expected = plant.lengthening_mm(course.motion, course.nominal)[course.kept]
            readings.append(np.sum(by_strut * expected, axis=1))
            law.append(columns[:, :1])
            left_open.append(columns)
        alone, beside = (_unexplained(np.concatenate(readings), np.vstack(columns)) for columns in (law, left_open))
        assert alone > 0.25
        assert beside < 0.6 * alone


def _unexplained(target, columns):
    return np.linalg.norm(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]) / np.linalg.norm(target)


def test_nothing_is_left_open_without_friction(reference):
    others = FRICTION.left_open(jig_runs()[0], reference, np.zeros(6)).strut_mm
    assert others.shape[-1] > 0
    assert np.array_equal(others, np.zeros_like(others))
