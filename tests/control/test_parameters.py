"""Parameters of genhexkins against brute force, and what the commands write of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.optimize import least_squares

from dbbstation.control.commands import correction_of, nominal_commands
from dbbstation.control.parameters import (
    LEVER_MM,
    Values,
    drawn_poses,
    exact_joints,
    hal_lines,
    home_mm,
    refitted,
    tables,
    tool_errors,
)
from dbbstation.errors import ModelError, OutputError, StationError, TravelError
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.machine.geometry import Frames
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.control import kinematics, parameters
from dbbstation.virtual.truth import random_kinematics
from tests.control.machines import machine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.control.parameters import LeftOfModel, Refitted
    from dbbstation.machine.geometry import Machine

LOW, HIGH = np.array([-100.0, -100.0, -1108.0, -15.0, -15.0, 0.0]), np.array([100.0, 100.0, -908.0, 15.0, 15.0, 0.0])
TODAY = "2026-11-27"


def truth_of(of: Machine, *names: str) -> MachineModel:
    drawn = np.random.default_rng(6)
    known = known_sources()
    sizes = {
        "gravity": np.array([9.7]),
        "screw-lead": drawn.normal(0.0, 40.0, 6),
        "screw-cyclic": drawn.normal(0.0, 2.0, 12),
    }
    sizes["backlash"] = np.array([3.0, 4.0, 5.0, 6.0, 7.0, 8.0])
    return MachineModel(of, (*random_kinematics(of, 3), *(Fitted(known[name], sizes[name]) for name in names)))


def given(of: Machine, numbers: NDArray[np.float64]) -> Values:
    """What 24 numbers say: six lengths, then the base joints."""
    points = np.array(of.travel.strut_mm)
    return Values(numbers[6:].reshape(6, 3), np.zeros((6, 3)), numbers[:6], points, np.zeros((6, 2)))


def test_refitting_finds_what_brute_force_finds(reference: Machine) -> None:
    """SciPy's least squares on the machine's errors, by finite differences, begun at the nominal machine."""
    of = machine(reference, 0)
    model = truth_of(of, "gravity")
    poses, others = drawn_poses(LOW, HIGH, 80, 1), drawn_poses(LOW, HIGH, 200, 2)
    at = Frames.from_poses(poses, of.hexapod.rotation)
    weights = np.array([1.0, 1.0, 1.0, LEVER_MM, LEVER_MM, LEVER_MM])

    def off(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        return (weights * tool_errors(model, given(of, numbers).joints(of, at), at)).reshape(-1)

    brute = least_squares(off, np.concatenate([of.reference_length_error_mm, np.zeros(18)]), x_scale=0.1, xtol=1e-12)
    found = refitted(model, poses, others)
    there = Frames.from_poses(others, of.hexapod.rotation)
    errors = 1e3 * tool_errors(model, given(of, brute.x).joints(of, there), there)[:, :3]
    by_brute_um = np.sqrt(np.mean(np.sum(np.square(errors), axis=1)))
    assert left_of(found)["24 refitted"].rms_um == pytest.approx(by_brute_um, rel=0.01)
    assert left_of(found)["42 refitted"].rms_um < left_of(found)["24 refitted"].rms_um
    assert (
        left_of(found)["24 refitted"].rms_um
        < 0.3 * left_of(found)["typed"].rms_um
        < 0.1 * left_of(found)["as it is"].rms_um
    )
    assert left_of(found)["program or kinematics"].largest_um < 1e-3


def left_of(found: Refitted) -> dict[str, LeftOfModel]:
    return {one.way: one for one in found.left}


def test_joints_and_lengths_alone_are_taken_out_wholly(reference: Machine) -> None:
    model = truth_of(machine(reference, 1))
    found = refitted(model, drawn_poses(LOW, HIGH, 60, 1), drawn_poses(LOW, HIGH, 60, 2))
    for way in ("typed", "24 refitted", "42 refitted"):
        assert left_of(found)[way].largest_um < 1e-4
    joints = model.sources[1].values.reshape(6, 3)
    assert np.abs(found.values.base_mm - joints).max() < 1e-5


def test_tables_hold_what_follows_strut_length(reference: Machine) -> None:
    model = truth_of(machine(reference, 1), "screw-lead", "screw-cyclic")
    found = refitted(model, drawn_poses(LOW, HIGH, 100, 1), drawn_poses(LOW, HIGH, 300, 2))
    by_name = {one.name: one for one in found.sources}
    assert by_name["screw-lead"].held_by == "table"
    assert by_name["screw-lead"].left_rms_um < 0.01 * by_name["screw-lead"].rms_um
    # A chord over h is off by y'' s (h - s) / 2: of a wave of length p in rms (2 pi h / p)² sqrt(1 / 120), to fourth order.
    h = float(np.diff(found.values.points_mm)[0])
    expected = (2.0 * np.pi * h / 10.0) ** 2 / np.sqrt(120.0)
    assert by_name["screw-cyclic"].held_by == "table"
    assert by_name["screw-cyclic"].left_rms_um / by_name["screw-cyclic"].rms_um == pytest.approx(expected, rel=0.25)
    assert left_of(found)["42 refitted"].rms_um < 1.5 * by_name["screw-cyclic"].left_rms_um


def test_a_table_has_play_on_both_sides(reference: Machine) -> None:
    found = refitted(truth_of(machine(reference, 0)), drawn_poses(LOW, HIGH, 40, 1), drawn_poses(LOW, HIGH, 40, 2))
    assert tables(found.values, np.zeros(6)) == ()
    texts = tables(found.values, np.full(6, 0.004))
    rows = np.array([[float(word) for word in line.split()] for line in texts[2].splitlines()])
    assert rows.shape == (256, 3)
    assert np.array_equal(rows[:, 0], np.sort(rows[:, 0]))
    assert np.allclose(rows[:, 1:], [0.002, -0.002])


def test_the_control_that_a_machine_file_states_drives_as_genhexkins_does(reference: Machine) -> None:
    of = machine(reference, 0)
    model = truth_of(of, "gravity")
    values = refitted(model, drawn_poses(LOW, HIGH, 60, 1), drawn_poses(LOW, HIGH, 20, 2)).values
    under = replace(of, control=correction_of("parameters", "0" * 64, TODAY, values.sources(), of))
    poses = drawn_poses(LOW, HIGH, 30, 3)
    commands = nominal_commands(under, poses, known_sources())
    driven = model.driven_mm(Frames.from_poses(commands, of.hexapod.rotation))
    # What genhexkins does with the printed values, from its own formula, homed with the printed offsets.
    printed = np.array([float(line.split()[-1]) for line in hal_lines(values, of)]).reshape(2, 6, 3)
    at = Frames.from_poses(poses, of.hexapod.rotation)
    ends = at.position_mm[:, None] + np.einsum("nij,kj->nki", at.rotation, printed[1])
    joints = np.linalg.norm(ends - printed[0], axis=2) - of.reference_length_error_mm - home_mm(values, of)
    assert np.abs(joints - driven).max() < 2e-6
    assert np.abs(joints - exact_joints(model, poses)).max() < 0.02


@pytest.fixture
def model_file(reference: Machine, tmp_path: Path) -> Path:
    model = truth_of(machine(reference, 0), "gravity", "screw-lead", "backlash")
    rows = tuple((f.source.name, "", p.name) for f in model.sources for p in f.source.parameters(model.machine))
    write_model(tmp_path / "model.yaml", IdentifiedModel(model, rows, np.zeros((len(rows), len(rows)))))
    return tmp_path / "model.yaml"


def test_it_writes_all_files_and_says_what_is_active(model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "mill.ini").write_text(
        "[JOINT_0]\nBACKLASH = 0.0\n[JOINT_1]\nBACKLASH = 0.005 # old\n[AXIS_X]\nBACKLASH = 1\n"
    )
    result = parameters(model_file, tmp_path / "out", date=TODAY, known=known_sources(), ini=tmp_path / "mill.ini")
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert (
        written
        == set(result.files)
        == {"genhexkins.hal", "parameters.csv", "machine.yaml", *(f"joint-{k}.comp" for k in range(6))}
    )
    assert [note for note in result.notes if "mill.ini" in note] == [
        "mill.ini: [JOINT_1] has BACKLASH = 0.005; the tables written here replace it, do not keep both"
    ]
    assert {one.name: one.held_by for one in result.sources} == {
        "strut-reference-length": "parameters",
        "base-joints": "parameters",
        "gravity": "parameters",
        "screw-lead": "table",
        "backlash": "table",
    }
    control = read_machine(tmp_path / "out" / "machine.yaml").control
    assert control is not None
    assert set(control.sources) == {"strut-reference-length", "base-joints", "platform-joints", "screw-lead"}
    with pytest.raises(OutputError):
        parameters(model_file, tmp_path / "out", date=TODAY, known=known_sources())


def test_a_volume_outside_the_travel_is_refused(model_file: Path, tmp_path: Path) -> None:
    for volume, why in (
        ([-400.0, 400.0, -10.0, 10.0, -1050.0, -950.0], "X"),
        ([-10.0, 10.0, -10.0, 10.0, -1300.0, -950.0], "Z"),
        ([-210.0, 210.0, -210.0, 210.0, -1208.0, -808.0], "strut"),  # in a corner, inside all axes
    ):
        with pytest.raises(TravelError, match=f"the volume, pose .*{why}"):
            parameters(model_file, tmp_path / "out", date=TODAY, known=known_sources(), volume_mm=volume, tilt_deg=26.0)
    with pytest.raises(StationError, match="the volume has no size"):
        parameters(
            model_file, tmp_path / "out", date=TODAY, known=known_sources(), volume_mm=[1.0, 1.0, 0.0, 1.0, 0.0, 1.0]
        )
    assert not (tmp_path / "out").exists()


def test_a_kinematics_says_that_homing_is_repeated(model_file: Path, tmp_path: Path) -> None:
    result = kinematics(
        model_file, tmp_path / "dbbkins.comp", date=TODAY, known=known_sources(), left_out=("backlash",)
    )
    assert [note for note in result.notes if "home all joints again after the change" in note]
    assert any("home again" in line for line in result.way_back)


def test_models_that_do_not_fit_are_refused(model_file: Path, reference: Machine, tmp_path: Path) -> None:
    for write in (
        lambda model, **more: kinematics(model, tmp_path / "dbbkins.comp", date=TODAY, known=known_sources(), **more),
        lambda model, **more: parameters(model, tmp_path / "out", date=TODAY, known=known_sources(), **more),
    ):
        with pytest.raises(ModelError, match="another machine"):
            write(model_file, machine=_other(reference, tmp_path))
        bare = IdentifiedModel(truth_of(machine(reference, 0)), (), np.zeros((0, 0)))
        write_model(tmp_path / "bare.yaml", bare, force=True)
        with pytest.raises(ModelError, match="does not state the uncertainty"):
            write(tmp_path / "bare.yaml")
    assert not (tmp_path / "dbbkins.comp").exists()
    assert not (tmp_path / "dbbkins.machine.yaml").exists()
    assert not (tmp_path / "out").exists()


def _other(reference: Machine, folder: Path) -> Path:
    (folder / "other.yaml").write_text(machine_text(machine(reference, 2)))
    return folder / "other.yaml"
