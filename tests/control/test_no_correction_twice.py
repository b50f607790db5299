"""A machine is corrected once: by its control or by its programs. What is measured under a correcting control evaluates right."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.control.commands import correction_of, nominal_commands
from dbbstation.errors import InputError, ModelError, StationError
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.new_session import write_session
from dbbstation.machine.geometry import refuse_second_correction
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from dbbstation.station.programs import load_programs
from dbbstation.tasks.calibrate import calibrate
from dbbstation.tasks.circle_programs import program
from dbbstation.tasks.compensate import compensate
from dbbstation.tasks.load import load
from dbbstation.tasks.simulate import simulate
from dbbstation.virtual.truth import random_kinematics
from tests.control.machines import machine, poses

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.machine.geometry import Machine

DIGEST = "fedcba9876543210" * 4
PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"

PART = "G21 G90 G94\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X20 F500\nM2\n"


def corrected(of: Machine, taken_out: tuple[Fitted, ...]) -> Machine:
    return replace(of, control=correction_of("kinematics", DIGEST, "2026-11-27", taken_out, of))


@pytest.fixture
def truth(reference: Machine) -> MachineModel:
    of = machine(reference, 0)
    return MachineModel(of, (*random_kinematics(of, 3), Fitted(known_sources()["gravity"], np.array([9.7]))))


def test_a_control_that_knows_the_machine_comes_to_the_commanded_pose(truth: MachineModel) -> None:
    wanted = poses(truth.machine, 50, 1)
    under = corrected(truth.machine, truth.sources)
    commands = nominal_commands(under, wanted, known_sources())
    assert np.abs(commands - wanted).max() > 0.01
    assert np.abs(truth.actual_poses(Motion(commands)) - wanted).max() < 1e-6
    assert nominal_commands(truth.machine, wanted, known_sources()) is wanted


def test_the_machine_file_keeps_what_the_control_corrects(truth: MachineModel, tmp_path: Path) -> None:
    under = corrected(truth.machine, truth.sources)
    (tmp_path / "machine.yaml").write_text(machine_text(under))
    read = read_machine(tmp_path / "machine.yaml")
    assert read.control == under.control
    with pytest.raises(
        StationError, match=r"corrects the machine already: kinematics of the model fedcba987654 since 2026-11-27"
    ):
        refuse_second_correction(read)


def test_a_source_that_follows_thermometers_is_refused(truth: MachineModel) -> None:
    law = known_sources()["thermal-struts"].by_temperature()
    assert law is not None
    under = corrected(truth.machine, (Fitted(law, np.array([11.0])),))
    with pytest.raises(ModelError, match=r"corrects the source thermal-struts, which"):
        nominal_commands(under, poses(truth.machine, 2, 1), known_sources())


def write_files(truth: MachineModel, folder: Path) -> tuple[Path, Path]:
    """The model of a machine, and its machine file under a control that corrects it."""
    rows = tuple((f.source.name, "", p.name) for f in truth.sources for p in f.source.parameters(truth.machine))
    write_model(folder / "model.yaml", IdentifiedModel(truth, rows, np.zeros((len(rows), len(rows)))))
    (folder / "machine.yaml").write_text(machine_text(corrected(truth.machine, truth.sources)))
    return folder / "model.yaml", folder / "machine.yaml"


def test_programs_are_not_compensated_for_a_control_that_corrects(truth: MachineModel, tmp_path: Path) -> None:
    model, of = write_files(truth, tmp_path)
    (tmp_path / "part.ngc").write_text(PART)
    with pytest.raises(StationError, match="corrects the machine already"):
        compensate(tmp_path / "part.ngc", model, tmp_path / "out.ngc", machine=of)
    with pytest.raises(StationError, match="corrects the machine already"):
        program(plan=PLAN, machine=of, out=tmp_path / "programs", model=model)
    assert not (tmp_path / "out.ngc").exists()
    assert not (tmp_path / "programs").exists()
    program(plan=PLAN, machine=of, out=tmp_path / "nominal")
    plan = read_plan(PLAN)
    assert load_programs(tmp_path / "nominal", plan, read_machine(of))


def test_compensated_programs_are_not_measured_under_a_control_that_corrects(
    truth: MachineModel, tmp_path: Path
) -> None:
    model, of = write_files(truth, tmp_path)
    (tmp_path / "plain.yaml").write_text(machine_text(truth.machine))
    program(plan=PLAN, machine=tmp_path / "plain.yaml", out=tmp_path / "programs", model=model)
    with pytest.raises(InputError, match="compensated already, says its header, and the control corrects already"):
        load_programs(tmp_path / "programs", read_plan(PLAN), read_machine(of))


def test_a_session_under_a_correcting_control_evaluates_right(
    reference: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Perfect circles under a control that takes errors out are those of a machine that has them: no other program is asked."""
    of = replace(reference, joint_tolerance_mm=0.05)
    truth = MachineModel(of, random_kinematics(of, 3))
    under = corrected(of, truth.sources)
    monkeypatch.setattr(
        "dbbstation.files.recordings.new_session.write_session", lambda to, _, *rest: write_session(to, under, *rest)
    )
    simulate(IdentifiedModel(MachineModel(of), (), np.zeros((0, 0))), PLAN).writing(tmp_path / "perfect")
    recorded = load(tmp_path / "perfect")
    assert any(
        "its control corrects by itself: kinematics of the model fedcba987654" in one for one in recorded.warnings
    )
    measured = recorded.observations[0]
    exact = truth.bar(measured.motion()).length_mm
    assert np.abs(exact - measured.raw.length_mm).max() < 2e-6  # written to a nanometre
    found = calibrate(tmp_path / "perfect", sources=["strut-reference-length", "base-joints"]).model
    nominal = MachineModel(of)
    at = poses(of, 200, 4) * [0.3, 0.3, 1.0, 0.3, 0.3, 1.0]
    moved = truth.actual_poses(Motion(at)) - nominal.actual_poses(Motion(at))
    predicted = found.model.anywhere().actual_poses(Motion(at)) - nominal.actual_poses(Motion(at))
    shift = (predicted - moved)[:, :3]
    assert np.abs(moved[:, :3]).max() > 0.1
    assert np.abs(shift - shift.mean(axis=0)).max() < 0.2 * np.abs(moved[:, :3]).max()
