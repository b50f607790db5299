"""Platform joints, the tool ball and the struts' screws: against exact geometry and what circles can see of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames, Rotation
from dbbstation.machine.kinematics import forward, inverse, strut_lengths
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.platform_joints import PlatformJoints
from dbbstation.sources.causes.screw_cyclic import ScrewCyclic
from dbbstation.sources.causes.screw_lead import ScrewLead
from dbbstation.sources.causes.tool_ball_offset import ToolBallOffset
from dbbstation.sources.contract import Fitted, Motion
from tests.sources.runs import concealed_share, jig_runs, random_machine, random_run, run

JOINTS, BALL, LEAD, CYCLIC = PlatformJoints(), ToolBallOffset(), ScrewLead(), ScrewCyclic()


@pytest.fixture(params=list(Rotation))
def machine(request, reference, rng):
    return random_machine(reference, request.param, rng)


def lengths(machine, motion):
    return strut_lengths(machine.hexapod, Frames.from_poses(motion.poses, machine.hexapod.rotation))


def swallowed(source, machine, motion):
    nothing = np.zeros(len(source.parameters(machine)))
    return concealed_share(machine, motion, lambda m: source.derivative(m, machine, nothing))


def test_shifted_platform_joints_move_the_pose_as_the_definition_says(machine, rng):
    """F^-1(F(T; P); P + dP), and the lengths of the result measured with the shifted joints."""
    motion, shift = random_run(rng, 40), rng.normal(0, 0.2, (6, 3))
    reached = MachineModel(machine, (Fitted(JOINTS, shift.ravel()),)).actual_poses(motion)
    actual = replace(machine, hexapod=machine.hexapod.moved(np.zeros((6, 3)), shift))
    assert np.allclose(lengths(actual, Motion(reached)), lengths(machine, motion)[motion.kept], atol=1e-9)


@pytest.mark.parametrize("offset", [(0.05, -0.08, 0.1), (7.0, -20.0, 40.0)])
def test_a_ball_off_the_tip_reads_exactly_as_platform_joints_all_shifted_the_other_way(machine, rng, offset):
    motion = random_run(rng, 60)
    by_ball = MachineModel(machine, (Fitted(BALL, np.array(offset), "session"),)).bar(motion).length_mm
    by_joints = MachineModel(machine, (Fitted(JOINTS, -np.tile(offset, 6)),)).bar(motion).length_mm
    assert np.abs(by_ball - MachineModel(machine).bar(motion).length_mm).max() > 0.01
    assert np.allclose(by_ball, by_joints, atol=1e-9)


def test_turned_by_half_a_turn_the_offset_across_the_axis_changes_its_sign(reference):
    upright = Motion(np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]]))
    offset = np.array([0.3, -0.2, 0.5])
    there = MachineModel(reference, (Fitted(BALL, offset),)).actual_poses(upright)[0, :3]
    turned = offset * [-1, -1, 1]
    back = MachineModel(reference, (Fitted(BALL, turned),)).actual_poses(upright)[0, :3]
    assert there == pytest.approx([0.3, -0.2, -1007.5], abs=1e-9)
    assert back == pytest.approx([-0.3, 0.2, -1007.5], abs=1e-9)


def test_a_lead_error_is_a_controller_that_counts_turns_of_another_screw(machine, rng):
    """Turns counted from the middle of the travel, made by a screw whose lead is 35 µm/m larger."""
    motion = random_run(rng, 50)
    middle = 0.5 * (machine.travel.strut_mm[0] + machine.travel.strut_mm[1])
    turns = (lengths(machine, motion) - middle) / machine.screw_lead_mm
    actual = middle + turns * machine.screw_lead_mm * (1 + 35e-6)
    error = LEAD.effect(motion, machine, np.full(6, 35.0)).strut_mm
    assert np.allclose(error, actual - lengths(machine, motion), atol=1e-10)


def test_ten_um_per_m_are_one_um_over_a_hundred_mm(reference):
    frames = Frames.from_poses(np.array([[0.0, 0.0, -1008.0, 0, 0, 0]]), reference.hexapod.rotation)
    at_840 = forward(reference.hexapod, np.full((1, 6), 840.0), frames)
    longer = forward(reference.hexapod, np.full((1, 6), 940.0), frames)
    poses = np.vstack([f.to_poses(reference.hexapod.rotation) for f in (at_840, longer)])
    error_um = 1e3 * LEAD.effect(Motion(poses), reference, np.full(6, 10.0)).strut_mm
    assert np.allclose(error_um, [[0.0] * 6, [1.0] * 6], atol=1e-6)


def test_the_ripple_comes_again_after_a_turn_of_the_screw(machine, rng):
    motion = random_run(rng, 30)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    sizes = rng.normal(0, 2, 12)

    def ripple_um(longer_mm):
        there = forward(machine.hexapod, lengths(machine, motion) + longer_mm, frames)
        poses = there.to_poses(machine.hexapod.rotation)
        return 1e3 * CYCLIC.effect(Motion(poses), machine, sizes).strut_mm

    here, lead = ripple_um(0.0), machine.screw_lead_mm
    assert np.allclose(ripple_um(lead), here, atol=1e-8)
    assert np.allclose(ripple_um(lead / 2), -here, atol=1e-8)
    # Each strut goes up and down by its own amplitude.
    amplitude = np.hypot(sizes[0::2], sizes[1::2])
    assert np.allclose(here**2 + ripple_um(lead / 4) ** 2, amplitude**2, atol=1e-8)


def test_another_lead_another_period(reference, rng):
    motion = random_run(rng, 200)
    fine = replace(reference, screw_lead_mm=5.0)
    assert "period 5 mm" in CYCLIC.parameters(fine)[0].meaning
    one = np.eye(12)[4]  # sine of strut 3
    error_um = 1e3 * CYCLIC.effect(motion, fine, one).strut_mm
    turns = inverse(fine.hexapod, Frames.from_poses(motion.poses, fine.hexapod.rotation)).length_mm[:, 2] / 5.0
    assert np.allclose(error_um[:, 2], np.sin(2 * np.pi * (turns - np.floor(turns))), atol=1e-9)
    assert not np.delete(error_um, 2, axis=1).any()


def test_a_machine_without_a_screw_lead_is_told_what_its_file_lacks(reference, rng):
    bare = replace(reference, screw_lead_mm=None)
    lacks = pytest.raises(ModelError, match=r"screw-cyclic needs the lead .* has no `screw_lead_mm`; add")
    with lacks:
        CYCLIC.parameters(bare)
    with lacks:
        CYCLIC.effect(random_run(rng), bare, np.ones(12))


def test_what_a_kinematic_calibration_swallows(reference):
    """Shares computed by two independent programs: joints 99 %, lead 93 to 96 %, ripple next to nothing."""
    motions = jig_runs(step_deg=2.0)
    assert (swallowed(JOINTS, reference, motions) > 0.99).all()
    lead = swallowed(LEAD, reference, motions)
    assert 0.925 < lead.min() < lead.max() < 0.965
    assert swallowed(CYCLIC, reference, motions).mean() == pytest.approx(0.01, abs=0.01)


def test_upright_circles_alone_show_nothing_of_platform_joints(reference):
    upright = [m for m in jig_runs(step_deg=10.0) if not m.poses[0, 3:5].any()]
    assert (swallowed(JOINTS, reference, upright) > 1 - 1e-9).all()


def test_a_ball_too_low_raises_every_upright_circle(reference):
    motion = run((0, 0, -1008), (0, 0))
    model = MachineModel(reference, (Fitted(BALL, np.array([0.0, 0.0, -0.1]), "session"),))
    expected = np.hypot(150.0, 0.1)
    assert np.allclose(model.bar(motion).length_mm, expected, atol=1e-9)
