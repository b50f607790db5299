"""The generated C against the model it was made from: an independent program of the same equations, compiled by gcc."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.control.kinematics import component, settings
from dbbstation.errors import ModelError, StationError
from dbbstation.files.places import package_text
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import forward
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from tests.control.compiled import COMPILER, Compiled
from tests.control.machines import THERMOMETERS, fitted, machine, model_of, pose_sources, poses

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.control.kinematics import Component
    from dbbstation.machine.geometry import Machine

DIGEST = "0123456789abcdef" * 4

NM = 1e-6
"""A nanometre [mm]."""

WARMER_K = 1.7

TOLERANCE = 0.1 * NM
"""Ten times better than the nanometre that the C is to keep [mm or deg]."""

POSES = 500


def made_of(model: MachineModel, **more: tuple[str, ...]) -> Component:
    return component(model, package_text, "dbbkins", DIGEST, **more)


def wanted(of: Machine, count: int, seed: int) -> Motion:
    """Poses under a machine that is warmer than at first; the first row is the zero of growth."""
    rows = poses(of, count, seed)
    rows = np.vstack([rows[:1], rows])
    degc = np.full(len(rows), 20.0 + WARMER_K)
    degc[0] = 20.0
    return Motion(rows, time_s=np.arange(len(rows)) * 1.0, logged={"machine_temp_c": degc})


def reached(model: MachineModel, joints: NDArray[np.float64], motion: Motion) -> NDArray[np.float64]:
    """Where the model's machine comes by joints that a control drives, rows 1 and up of a motion [mm, deg]."""
    of = model.machine
    near = motion.frames(of)
    near = Frames(near.position_mm[1:], near.rotation[1:])
    command = forward(of.hexapod, joints + of.reference_length_error_mm, near).to_poses(of.hexapod.rotation)
    return model.actual_poses(replace(motion, poses=np.vstack([motion.poses[:1], command])))[1:]


@COMPILER
@pytest.mark.parametrize("source", pose_sources(), ids=lambda source: f"{source.name} {source.law}")
def test_each_source_states_in_c_what_it_is_in_the_model(source, reference: Machine, tmp_path: Path) -> None:
    of = machine(reference, 1)
    model = MachineModel(of, (fitted(source, of, 5),))
    motion = wanted(of, 60, 1)
    compiled = Compiled(made_of(model, thermometers=THERMOMETERS), tmp_path)
    compiled.warm(np.array([WARMER_K]))
    joints, wrong = compiled.inverse(motion.poses[1:])
    assert not wrong.any()
    assert np.abs(reached(model, joints, motion) - motion.poses[1:]).max() < TOLERANCE
    assert np.abs(joints - model.driven_mm(motion.frames(of))[1:]).max() > 10.0 * NM  # it does something
    back, wrong = compiled.forward(joints, motion.poses[1:] + np.array([1.0, -1.0, 0.5, 0.1, -0.1, 0.05]))
    assert not wrong.any()
    assert np.abs(back - motion.poses[1:]).max() < TOLERANCE


@COMPILER
@pytest.mark.parametrize("number", [0, 1, 2])
def test_all_sources_together_take_the_model_to_the_pose(number: int, reference: Machine, tmp_path: Path) -> None:
    of = machine(reference, number)
    found: dict[str, object] = {}
    for source in pose_sources():
        found.setdefault(source.name, source)
    model = model_of(of, list(found.values()), number)
    motion = wanted(of, POSES, number)
    compiled = Compiled(made_of(model, thermometers=THERMOMETERS), tmp_path)
    compiled.warm(np.array([WARMER_K]))
    joints, wrong = compiled.inverse(motion.poses[1:])
    assert not wrong.any()
    assert np.abs(reached(model, joints, motion) - motion.poses[1:]).max() < TOLERANCE
    near, wrong = compiled.forward(joints, np.zeros_like(joints))  # from outside the travel
    assert not wrong.any()
    assert np.abs(near - motion.poses[1:]).max() < TOLERANCE


def test_what_has_a_history_is_refused_by_name(reference: Machine) -> None:
    of = machine(reference, 0)
    play = Fitted(known_sources()["backlash"], np.full(6, 3.0))
    lag = Fitted(known_sources()["servo-lag"], np.full(6, 0.001))
    lengths = Fitted(known_sources()["strut-reference-length"], np.full(6, 0.1))
    with pytest.raises(ModelError, match=r"backlash depends on the way so far.*--leave-out backlash.*BACKLASH"):
        made_of(MachineModel(of, (lengths, play)))
    with pytest.raises(ModelError, match=r"servo-lag depends on the way so far"):
        made_of(MachineModel(of, (lengths, lag)))
    warm = Fitted(known_sources()["thermal-struts"], np.array([20.0, 3600.0, 0.0]))
    with pytest.raises(ModelError, match=r"thermal-struts depends on .* time"):
        made_of(MachineModel(of, (warm,)))
    made = made_of(MachineModel(of, (lengths, play)), left_out=("backlash",))
    assert made.parts == ("strut-reference-length",)
    assert made.left_out == ("backlash",)
    ini, _ = settings(made, MachineModel(of, (lengths, play)))
    assert ini.count("BACKLASH = 0.003000") == 6


def test_a_thermometer_that_the_control_lacks_is_named(reference: Machine) -> None:
    of = machine(reference, 0)
    source = known_sources()["thermal-struts"].by_temperature()
    assert source is not None
    with pytest.raises(
        ModelError, match=r"thermal-struts follows a thermometer, and the control has no .*machine_temp_c"
    ):
        made_of(MachineModel(of, (Fitted(source, np.array([11.0])),)))


@pytest.mark.parametrize("name", ["Kins", "1kins", "my-kins", "int", "k" * 21, ""])
def test_a_name_that_is_not_c_is_refused(name: str, reference: Machine) -> None:
    with pytest.raises(StationError, match="cannot be the name of a component in C"):
        component(MachineModel(reference), package_text, name, DIGEST)


def test_a_source_that_is_not_there_cannot_be_left_out(reference: Machine) -> None:
    with pytest.raises(StationError, match="no source gravity to leave out"):
        made_of(MachineModel(reference), left_out=("gravity",))


@COMPILER
def test_it_faults_and_gives_no_joints(reference: Machine, tmp_path: Path) -> None:
    of = machine(reference, 0)
    compiled = Compiled(made_of(MachineModel(of, (Fitted(known_sources()["gravity"], np.array([9.7])),))), tmp_path)
    low = np.array([[0.0, 0.0, -1900.0, 0.0, 0.0, 0.0]])  # struts of over 1380 mm
    joints, wrong = compiled.inverse(low)
    assert wrong.tolist() == [1]
    assert not joints.any()
    _, wrong = compiled.forward(np.full((1, 6), 2000.0), low)
    assert wrong.tolist() == [1]
    _, wrong = compiled.inverse(np.full((1, 6), np.nan))
    assert wrong.tolist() == [2]
    pose, wrong = compiled.forward(np.array([[400.0, 1300.0, 400.0, 1300.0, 400.0, 1300.0]]), np.zeros((1, 6)))
    assert wrong.tolist() == [2]  # no pose has such struts
    assert not pose.any()


@COMPILER
def test_a_part_that_is_switched_off_corrects_nothing(reference: Machine, tmp_path: Path) -> None:
    of = machine(reference, 0)
    sources = [known_sources()[name] for name in ("strut-reference-length", "gravity")]
    model = model_of(of, sources, 3)
    compiled = Compiled(made_of(model), tmp_path)
    motion = wanted(of, 20, 3)
    compiled.library.switched(1, 0)
    joints, _ = compiled.inverse(motion.poses[1:])
    without = MachineModel(of, model.sources[:1])
    assert np.abs(reached(without, joints, motion) - motion.poses[1:]).max() < TOLERANCE
    assert np.abs(reached(model, joints, motion) - motion.poses[1:]).max() > 1000.0 * NM


@pytest.mark.nightly
@COMPILER
@pytest.mark.parametrize("number", [0, 1, 2])
def test_ten_thousand_poses_of_three_machines(
    number: int, reference: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "POSES", 10_000)
    test_all_sources_together_take_the_model_to_the_pose(number, reference, tmp_path)
