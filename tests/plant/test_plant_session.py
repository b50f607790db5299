"""Session folders as the plant writes them: format, truth, and that the answer stays sealed."""

from __future__ import annotations

import ast
import csv
import hashlib
import json
import time
import zlib
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from tests.plant.arrays import FloatArray
from tests.plant.files import flow
from tests.plant.hexapod import strut_lengths
from tests.plant.machine import random_machine, reference_machine
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.balls import BadSeating, BallCoordinates
from tests.plant.mechanisms.bar import BarDrift, BarOffset
from tests.plant.mechanisms.base import Mechanism
from tests.plant.mechanisms.currents import DriveCurrents
from tests.plant.mechanisms.gravity import CentreOfGravityShift, Gravity
from tests.plant.mechanisms.joints import JointFriction, JointRunout, UjointScrew
from tests.plant.mechanisms.kinematics import Kinematics, RandomKinematics
from tests.plant.mechanisms.oddities import (
    BentCover,
    CreepingSpindle,
    CyclingChiller,
    RockingTable,
    SpringyDrive,
    WindingCable,
)
from tests.plant.mechanisms.outsiders import (
    BuildingSway,
    DentedScrew,
    HoseDrag,
    LobedSocket,
    OddGearWobble,
    SoftFloor,
)
from tests.plant.mechanisms.play import Play
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ReversalSpike, ServoLag, TimeSkew
from tests.plant.mechanisms.set_up import BallForm, BarCyclic, JigDistortion, ToolBallOffset
from tests.plant.mechanisms.thermal import JigThermal, SpindleGrowth, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.weights import BaseCompliance, StrutBending, StrutWeight
from tests.plant.noise import Noise
from tests.plant.plan import (
    TABLE_II,
    Path,
    Test,
    elevated,
    free_ball,
    gravity_plan,
    subset,
    table_ii_plan,
    with_test,
)
from tests.plant.rotation import CONVENTIONS
from tests.plant.sensitivity import readings
from tests.plant.session import Program, record

SHORT = subset(table_ii_plan(3), ["a", "h"])
SILENT = Noise(white_um=0.0)
EVERYTHING: tuple[Mechanism, ...] = (
    RandomKinematics(platform_sd_mm=0.02),
    Gravity(),
    CentreOfGravityShift((5.0, 0.0, 10.0)),
    StrutWeight(),
    BaseCompliance(),
    StrutBending(),
    Backlash(),
    Play(),
    ScrewLead(),
    ScrewCyclic(),
    ServoLag(),
    ReversalSpike(),
    TimeSkew(),
    JointFriction(),
    JointRunout(np.full((6, 3), 5.0)),
    UjointScrew(),
    ThermalStruts(),
    ThermalFrame(),
    SpindleGrowth(),
    JigThermal(),
    JigDistortion(),
    ToolBallOffset((0.01, 0.0, 0.0)),
    BarOffset(0.4),
    BarDrift(),
    BarCyclic(),
    BallForm(),
    BadSeating({1: np.array([10.0, 0.0, 0.0])}),
    BallCoordinates({"9-short": np.array([0.0, 8.0, 0.0])}),
    OddGearWobble(),
    SoftFloor(),
    LobedSocket(),
    HoseDrag(),
    DentedScrew(),
    BuildingSway(),
    BentCover(),
    SpringyDrive(),
    CreepingSpindle(),
    RockingTable(),
    CyclingChiller(),
    WindingCable(),
)


def read_yaml(file: FilePath) -> Any:
    return YAML(typ="safe").load(file)


def read_run(file: FilePath) -> dict[str, FloatArray]:
    lines = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_the_plant_never_touches_the_package_that_it_examines() -> None:
    for file in FilePath(__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.split(".")[0] in {"dbbstation", "studies"}], file


def test_a_recording_looks_like_those_of_a_station(tmp_path: FilePath) -> None:
    record(tmp_path / "s", seed=1, plan=SHORT)
    lines = (tmp_path / "s/runs/h-cw-1.csv").read_text(encoding="utf-8").splitlines()
    assert lines[:4] == ["# test: h", "# direction: cw", "# repeat: 1", "t_s,length_mm"]
    assert lines[4].startswith("0.0000,151.")
    assert lines[5].startswith("0.0200,151.")
    columns = read_run(tmp_path / "s/runs/h-cw-1.csv")
    # 2.6 s of dwell, 450 degrees and two feeds of 1.5 mm at 1000 mm/min, three ramps, at 50 Hz.
    assert len(columns["t_s"]) in {3677, 3678, 3679}


def test_the_list_of_runs(tmp_path: FilePath) -> None:
    folder = tmp_path / "s"
    truth = record(folder, seed=1, plan=replace(SHORT, repeat_at_end=("a",)))
    session = read_yaml(folder / "session.yaml")
    assert session["format"] == "dbb-session/1"
    runs = session["runs"]
    assert [(run["test"], run["direction"], run["repeat"], run["mounting"]) for run in runs] == [
        ("a", "ccw", 1, 1),
        ("a", "cw", 1, 1),
        ("h", "ccw", 1, 2),
        ("h", "cw", 1, 2),
        ("a", "ccw", 2, 3),
        ("a", "cw", 2, 3),
    ]
    started = [run["started"] for run in runs]
    assert [(moment - started[0]).total_seconds() for moment in started] == [200.0 * k for k in range(6)]
    assert "started: 2026-11-20T08:03:20Z, state: accepted" in (folder / "session.yaml").read_text()
    for run in runs:
        assert hashlib.sha256((folder / run["file"]).read_bytes()).hexdigest() == run["sha256"]
    assert sorted(file.name for file in folder.iterdir()) == ["machine.yaml", "plan.yaml", "runs", "session.yaml"]
    assert len(truth.runs) == 6
    assert set(truth.mounting_shift_um) == {1, 2, 3}


def test_without_mounting_numbers_a_test_is_one_mounting(tmp_path: FilePath) -> None:
    plan = replace(SHORT, repeat_at_end=("a",))
    truth = record(tmp_path / "s", seed=1, plan=plan, mounting_numbers=False)
    assert all("mounting" not in run for run in read_yaml(tmp_path / "s/session.yaml")["runs"])
    assert [slot.mounting for slot in truth.scene.slots] == [1, 1, 2, 2, 1, 1]


def test_plan_and_machine_say_what_was_simulated(tmp_path: FilePath) -> None:
    plan = elevated(SHORT, 5.0, ["h"])
    free = free_ball("free-1", [-70.01, -69.98, 142.003])
    plan = with_test(plan, Test("p", "free-1", 17, -17, path=Path(radius_mm=144.0)), free)
    plan = replace(plan, repeat_at_end=("a",), rotation_about_z_deg=2.0)
    machine = random_machine(9, rotation=CONVENTIONS[1])
    truth = record(tmp_path / "s", seed=1, plan=plan, machine=machine)
    written = read_yaml(tmp_path / "s/plan.yaml")
    assert written["format"] == "dbb-plan/1"
    assert written["path"]["directions"] == ["ccw", "cw"]
    assert [test["name"] for test in written["tests"]] == ["a", "h", "p"]
    assert written["tests"][1]["elevation_deg"] == 5.0
    assert written["tests"][2]["path"] == {"radius_mm": 144.0}
    assert written["balls"]["free-1"] == {
        "bore": None,
        "holder": "custom",
        "centre_mm": [-70.01, -69.98, 142.003],
        "uncertainty_um": 0.5,
    }
    assert written["repeat_at_end"] == ["a"]
    assert written["jig"]["rotation_about_z_deg"] == 2.0
    assert written["jig"]["bores"][8] == [100, 100]
    hexapod = read_yaml(tmp_path / "s/machine.yaml")
    assert hexapod["rotation"] == "Rz(C) Ry(B) Rx(A)"
    np.testing.assert_array_equal(hexapod["base_joints_mm"], truth.nominal.base_joints_mm)
    np.testing.assert_array_equal(hexapod["platform_joints_mm"], truth.nominal.platform_joints_mm)


def test_the_jig_plan_is_that_of_the_paper() -> None:
    plan = table_ii_plan(2)
    assert [test.name for test in plan.tests] == list("abcdefghijklmno")
    for (_, bore, _, a_deg, b_deg), test in zip(TABLE_II, plan.tests, strict=True):
        ball = plan.ball(test.ball)
        assert ball.bore == bore
        # The tool always points towards the middle of the machine.
        x_mm, y_mm = np.round(np.array(ball.centre_mm)[:2], -1)
        assert (np.sign(b_deg), np.sign(a_deg)) == (np.sign(x_mm), -np.sign(y_mm))
    assert [test.name for test in gravity_plan().tests] == list("ABCDEFGHI")


def test_without_noise_the_recording_is_the_truth(tmp_path: FilePath) -> None:
    truth = record(tmp_path / "s", seed=1, plan=SHORT, mechanisms=[RandomKinematics()], noise=SILENT, angles=True)
    columns = read_run(tmp_path / "s/runs/a-cw-1.csv")
    theta_deg, length_mm = truth.noise_free_lengths("a", "cw")
    np.testing.assert_allclose(columns["length_mm"], length_mm, atol=0.5001e-4)
    np.testing.assert_allclose(columns["theta_deg"], np.mod(theta_deg, 360.0), atol=0.5001e-4)
    assert columns["t_s"][0] == 0.0
    assert np.all(np.diff(theta_deg) < 0)


def test_the_reading_is_the_distance_of_the_balls_where_they_really_are(tmp_path: FilePath) -> None:
    truth = record(tmp_path / "s", seed=4, plan=SHORT, mechanisms=[RandomKinematics(0.1, 0.1, 0.05), Gravity()])
    run = truth.run("h", "ccw")
    poses = run.slot.path.poses(run.time_s + 0.0)
    # The recorder begins somewhere in the first sampling interval: find where, by the angles that it should have.
    late_s = (
        np.median((run.theta_deg - run.slot.path.angle_deg(run.time_s))[run.in_circle])
        * np.radians(150.0)
        / (1000 / 60)
    )
    poses = run.slot.path.poses(run.time_s + late_s)
    ball_mm = (
        np.array(truth.scene.plan.ball("5-long").centre_mm)
        + np.array([0.0, 0.0, -1150.0])
        + (truth.mounting_shift_um[2] + truth.ball_error_um["5-long"]) / 1000.0
    )
    expected_mm = np.linalg.norm(truth.actual_pose(poses)[:, :3] - ball_mm, axis=1) + truth.bar_offset_um / 1000.0
    np.testing.assert_allclose(run.length_mm[run.in_circle], expected_mm[run.in_circle], atol=1e-6)


def test_drawn_errors_have_the_sizes_asked_for(tmp_path: FilePath) -> None:
    truths = [
        record(tmp_path / str(k), seed=k, rate_hz=1.0, mechanisms=[RandomKinematics(0.05, 0.1)]) for k in range(6)
    ]
    assert np.std([truth.delta_length_mm for truth in truths]) == pytest.approx(0.05, rel=0.35)
    assert np.std([truth.delta_base_mm for truth in truths]) == pytest.approx(0.1, rel=0.2)
    shifts = [[truth.mounting_shift_um[k] for k in range(6, 16)] for truth in truths]
    assert np.std(shifts) == pytest.approx(1.85, rel=0.2)
    # [CAL III-B]: 3.2 µm in space for the long holder.
    assert np.sqrt(np.mean(np.sum(np.square(shifts), axis=2))) == pytest.approx(3.2, rel=0.2)


def test_adding_a_mechanism_leaves_the_other_draws_alone(tmp_path: FilePath) -> None:
    one = record(tmp_path / "1", seed=7, plan=SHORT, rate_hz=1.0, mechanisms=[RandomKinematics()])
    two = record(tmp_path / "2", seed=7, plan=SHORT, rate_hz=1.0, mechanisms=[DriveCurrents(), RandomKinematics()])
    np.testing.assert_array_equal(one.delta_base_mm, two.delta_base_mm)
    np.testing.assert_array_equal(one.mounting_shift_um[2], two.mounting_shift_um[2])


def test_the_same_seed_writes_the_same_bytes(tmp_path: FilePath) -> None:
    for name in ("1", "2"):
        record(tmp_path / name, seed=7, plan=SHORT, rate_hz=5.0, mechanisms=EVERYTHING)
    for file in (tmp_path / "1").rglob("*.*"):
        assert file.read_bytes() == (tmp_path / "2" / file.relative_to(tmp_path / "1")).read_bytes()


def test_the_answer_stays_outside_the_session(tmp_path: FilePath) -> None:
    truth = record(tmp_path / "s", seed=5, plan=SHORT, rate_hz=5.0, mechanisms=EVERYTHING)
    with pytest.raises(ValueError, match="inside the session"):
        truth.write(tmp_path / "s/answer.json")
    truth.write(tmp_path / "answer.json")
    answer = json.loads((tmp_path / "answer.json").read_text())
    np.testing.assert_allclose(answer["delta_base_mm"], truth.delta_base_mm)
    names = [mechanism["name"] for mechanism in answer["mechanisms"]]
    assert {"backlash", "gravity", "soft-floor", "mounting"} <= set(names)
    unlisted = [mechanism["name"] for mechanism in answer["mechanisms"] if not mechanism["listed"]]
    assert len(unlisted) == 12
    told = (tmp_path / "s/session.yaml").read_text() + (tmp_path / "s/plan.yaml").read_text()
    assert not [name for name in names if name in told and name != "mounting"]


@pytest.mark.parametrize("mechanism", EVERYTHING, ids=lambda mechanism: type(mechanism).__name__)
def test_every_mechanism_shows_by_itself(mechanism: Mechanism) -> None:
    # On a perfect circle about the ball a late sample reads the same, and so does a scale that stands still.
    about: list[Mechanism] = [Kinematics(base_mm=np.tile([1.0, 0.0, 0.0], (6, 1)))]
    if isinstance(mechanism, (CentreOfGravityShift, StrutWeight)):
        about.append(Gravity())
    if isinstance(mechanism, RandomKinematics):
        mechanism = Kinematics(length_mm=np.full(6, 0.01))
    change_um = 1000.0 * (readings(SHORT, [*about, mechanism], rate_hz=10.0) - readings(SHORT, about, rate_hz=10.0))
    # Sag is the one that is known to be negligible [GRAV 3.1].
    floor_um = 0.005 if isinstance(mechanism, StrutBending) else 0.2
    assert floor_um < np.abs(change_um).max() < 200.0


def test_currents_carry_the_load_that_friction_hides(tmp_path: FilePath) -> None:
    currents = DriveCurrents(noise_a=0.0)
    truth = record(tmp_path / "s", seed=5, plan=SHORT, mechanisms=[Gravity(), currents], angles=True)
    columns = {direction: read_run(tmp_path / f"s/runs/h-{direction}-1.csv") for direction in ("ccw", "cw")}
    order = {direction: np.argsort(run["theta_deg"]) for direction, run in columns.items()}
    theta_deg = np.arange(5.0, 355.0, 5.0)
    x_mm, y_mm, z_mm = np.array(truth.scene.plan.ball("5-long").centre_mm) + np.array([0.0, 0.0, -1150.0])
    poses = np.stack(
        [
            x_mm + 150 * np.cos(np.radians(theta_deg)),
            y_mm + 150 * np.sin(np.radians(theta_deg)),
            np.full(70, z_mm),
            np.full(70, 15.0),
            np.zeros(70),
            np.zeros(70),
        ],
        axis=1,
    )
    load_n = truth.tensions_n(poses)
    strut_mm = strut_lengths(truth.nominal, poses)
    for strut in range(6):
        both = [
            np.interp(theta_deg, run["theta_deg"][order[way]], run[f"motor{strut + 1}_current_a"][order[way]])
            for way, run in columns.items()
        ]
        # The mean of both directions is free of friction; the rest is the weight of what moves with the strut.
        extra_n = currents.gain_n_a[strut] * (both[0] + both[1]) / 2 - load_n[:, strut]
        # Away from where the strut turns round, where friction turns over a little later each way.
        away = np.abs(np.gradient(strut_mm[:, strut], theta_deg)) > 0.3
        assert extra_n[away].min() > 15.0 * 9.81 * 0.3
        assert extra_n[away].max() < 15.0 * 9.81 * 1.0
        friction_n = currents.gain_n_a[strut] * np.abs(both[0] - both[1])[away] / 2
        assert np.median(friction_n) > currents.coulomb_n[strut]


def test_lines_can_carry_their_check(tmp_path: FilePath) -> None:
    record(tmp_path / "s", seed=5, plan=SHORT, rate_hz=5.0, mechanisms=[BarDrift(logged=True)], crc=True)
    lines = (tmp_path / "s/runs/a-ccw-1.csv").read_text().splitlines()
    assert lines[3] == "t_s,length_mm,bar_temp_c,crc"
    for line in lines[4:]:
        content, check = line.rsplit(",", 1)
        assert check == f"{zlib.crc32(content.encode()):08x}"


def test_a_compensated_program_changes_what_is_commanded(tmp_path: FilePath) -> None:
    errors = Kinematics(base_mm=np.tile([0.05, 0.0, 0.0], (6, 1)))

    def back(_slot: object, poses: FloatArray) -> FloatArray:
        return poses - np.array([0.05, 0, 0, 0, 0, 0])

    programs = {"a-cw": Program("G1 X1\n", model_sha256="c0" * 32)}
    truth = record(tmp_path / "s", seed=5, plan=SHORT, mechanisms=[errors], setup=[], reprogram=back, programs=programs)
    runs = read_yaml(tmp_path / "s/session.yaml")["runs"]
    assert [run["file"] for run in runs if "program" in run] == ["runs/a-cw-1.csv"]
    assert runs[1]["program"] == {
        "file": "programs/a-cw.ngc",
        "sha256": hashlib.sha256(b"G1 X1\n").hexdigest(),
        "model_sha256": "c0" * 32,
    }
    assert (tmp_path / "s/programs/a-cw.ngc").read_text() == "G1 X1\n"
    for test in ("a", "h"):
        np.testing.assert_allclose(truth.noise_free_lengths(test, "ccw")[1], 150.0, atol=1e-6)


def test_a_break_is_a_pause_before_a_test(tmp_path: FilePath) -> None:
    truth = record(tmp_path / "s", seed=5, plan=SHORT, rate_hz=1.0, breaks_s={"h": 1000.0})
    assert [slot.start_s for slot in truth.scene.slots] == [0.0, 200.0, 1400.0, 1600.0]


def test_a_slow_circle_pushes_the_next_run_back(tmp_path: FilePath) -> None:
    truth = record(tmp_path / "s", seed=5, plan=replace(SHORT, path=Path(feed_mm_min=200.0)), rate_hz=1.0)
    starts_s = [slot.start_s for slot in truth.scene.slots]
    assert starts_s == [0.0, 400.0, 800.0, 1200.0]


def test_a_whole_session_takes_no_time(tmp_path: FilePath) -> None:
    begin_s = time.process_time()
    record(tmp_path / "s", seed=1, mechanisms=[RandomKinematics(), Gravity(), Backlash(), ThermalStruts()])
    assert time.process_time() - begin_s < 6.0  # about 1 s on a machine with nothing else to do


@pytest.mark.parametrize("text", ["a", "e", "9-short", "two words", "1e5", "12e34", "on", "x: y", "", "µ", "-1"])
def test_strings_survive_one_line_style(text: str) -> None:
    assert YAML(typ="safe").load(flow({"key": [text]})) == {"key": [text]}


def test_the_reference_machine_has_the_mass_of_the_condition_tables() -> None:
    assert reference_machine().platform_kg * 9.81 == pytest.approx(3924.0)
