"""The model against its definition, its inversion, and the propagation of its uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames, Rotation
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.model.compensation import compensated
from dbbstation.model.identified import IdentifiedModel, position_uncertainty_mm
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from studies.gravity import shifted

KNOWN = known_sources()
CIRCLE = Circle((0, 100, -1008), (0, 100, -1008), 144, (-20, 5, 2), 1000, 0, 45, 1.5, 0, Direction.CCW)


def fitted(name, *values):
    return Fitted(KNOWN[name], np.array(values, dtype=float))


@pytest.fixture(params=list(Rotation))
def machine(request, reference):
    return replace(
        reference,
        hexapod=replace(reference.hexapod, rotation=request.param),
        reference_length_error_mm=np.array([0.02, -0.05, 0.0, 0.01, 0.03, -0.02]),
    )


@pytest.fixture
def kinematics(rng):
    return (
        fitted("strut-reference-length", *rng.normal(0, 0.1, 6)),
        fitted("base-joints", *rng.normal(0, 0.15, 18)),
    )


def path(step_deg=1.0):
    return Motion(CIRCLE.poses(np.arange(-45.0, 360.0, step_deg)), is_path=True)


def test_actual_pose_is_the_forward_solution_of_the_definition(machine, kinematics):
    """F^-1(F(T; nominal) - controller's correction + dL; Q + dQ), written out."""
    lengths, joints = kinematics[0].values, kinematics[1].values.reshape(6, 3)
    motion = path(10.0)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    driven = inverse(machine.hexapod, frames).length_mm - machine.reference_length_error_mm
    expected = forward(machine.hexapod.moved(joints, np.zeros((6, 3))), driven + lengths, frames)
    got = MachineModel(machine, kinematics).actual_poses(motion)
    assert np.allclose(got, expected.to_poses(machine.hexapod.rotation), atol=1e-9)


def test_a_controller_that_corrects_its_strut_errors_is_right(machine):
    errors = fitted("strut-reference-length", *machine.reference_length_error_mm)
    motion = path(10.0)
    assert np.allclose(MachineModel(machine, (errors,)).actual_poses(motion), motion.poses, atol=1e-9)


@pytest.mark.parametrize(
    "more",
    [
        (),
        (("gravity", 9.68),),
        (("backlash", 3.0, -2.0, 5.0, 1.0, 0.0, 4.0),),
        (("gravity", 9.68), ("backlash", *[3.0] * 6)),
    ],
)
def test_compensation_takes_the_machine_where_it_should_go(machine, kinematics, more):
    model = MachineModel(machine, (*kinematics, *(fitted(*one) for one in more)))
    wanted = path()
    commanded = compensated(model, wanted)
    reached = model.actual_poses(replace(wanted, poses=commanded))
    assert np.abs(reached - wanted.poses).max() < 1e-8
    assert np.abs(commanded - wanted.poses).max() > 0.01


def test_the_published_shift_leaves_second_order_and_the_tilt(machine, kinematics):
    model = MachineModel(machine, (*kinematics, fitted("gravity", 9.68)))
    wanted = path()
    reached = model.actual_poses(replace(wanted, poses=shifted(model, wanted)))
    position = np.abs(reached - wanted.poses)[:, :3].max()
    assert 1e-8 < position < 2e-3
    assert np.abs(reached - wanted.poses)[:, 3:].max() > 1e-3


def test_what_a_session_owns_is_not_compensated(machine):
    model = MachineModel(machine, (fitted("bar-offset", 0.01),))
    wanted = path(10.0)
    assert np.array_equal(compensated(model, wanted), compensated(MachineModel(machine), wanted))


def test_a_source_without_what_it_needs_is_refused_by_name(machine):
    model = MachineModel(machine, (fitted("backlash", *[3.0] * 6),))
    with pytest.raises(ModelError, match="backlash needs path"):
        model.actual_poses(Motion(path(10.0).poses))


def test_position_uncertainty_is_that_of_many_drawn_machines(machine, kinematics, rng):
    names = [(f.source.name, "", p.name) for f in kinematics for p in f.source.parameters(machine)]
    spread = rng.normal(0, 0.004, (24, 24))
    covariance = spread @ spread.T
    identified = IdentifiedModel(MachineModel(machine, kinematics), tuple(names), covariance)
    motion = path(60.0)
    stated = position_uncertainty_mm(identified, motion)
    mean = np.concatenate([f.values for f in kinematics])
    drawn = []
    for x in rng.multivariate_normal(mean, covariance, 1500):
        sources = (replace(kinematics[0], values=x[:6]), replace(kinematics[1], values=x[6:]))
        drawn.append(MachineModel(machine, sources).actual_poses(motion)[:, :3])
    assert np.allclose(np.std(drawn, axis=0), stated, rtol=0.1)


@pytest.mark.parametrize(
    ("axis", "turned"),
    [
        (0, lambda x, y, z, c, s: [x, c * y - s * z, s * y + c * z]),
        (1, lambda x, y, z, c, s: [c * x + s * z, y, c * z - s * x]),
        (2, lambda x, y, z, c, s: [c * x - s * y, s * x + c * y, z]),
    ],
    ids="abc",
)
def test_a_tip_off_its_place_is_turned_with_the_platform(machine, axis, turned):
    """A vector that is fixed in the platform turns by the elementary rotation about one axis, in every convention of angles."""
    exact = replace(machine, reference_length_error_mm=np.zeros(6))
    pose = np.array([10.0, -20.0, -1000.0, 0.0, 0.0, 0.0])
    pose[3 + axis] = 12.0
    off = np.array([0.3, -0.5, 0.8])
    found = MachineModel(exact, (fitted("tool-ball-offset", *off),)).actual_poses(Motion(pose[None]))[0]
    angle = np.radians(12.0)
    assert found[:3] - pose[:3] == pytest.approx(turned(*off, np.cos(angle), np.sin(angle)), abs=1e-9)
    assert found[3:] == pytest.approx(pose[3:], abs=1e-9)
