"""Plans and sessions of the conventional circular test on the command line."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.cli import DONE
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.truth import random_kinematics
from tests.virtual.brute_force import tool

FIXTURES = shipped_folder("fixtures")
PLAN = shipped_folder("protocols") / "plans" / "conventional.yaml"
SESSION = FIXTURES / "sessions" / "under-spindle"


@pytest.fixture(scope="module")
def truth():
    machine = read_machine(FIXTURES / "machines" / "reference.yaml")
    return MachineModel(machine, random_kinematics(machine, 7))


@pytest.fixture
def model_file(truth, tmp_path):
    path = tmp_path / "model.yaml"
    write_model(path, IdentifiedModel(truth, (("base-joints", "", "joint_1_x_mm"),), np.eye(1)))
    return path


def test_simulate_puts_the_ball_up_where_the_model_has_the_tool_tip(run, truth, model_file, tmp_path):
    out = tmp_path / "predicted"
    outcome = run("simulate", "--model", model_file, PLAN, "--out", out, "--samples", 36)
    assert outcome.code == DONE
    session = read_session(out)
    assert len(session.runs) == 30
    for entry in session.runs[2:12:3]:
        circle = session.circle(entry)
        ball, _ = tool(truth, np.array([*circle.ball_mm, *circle.tilt_deg]))
        recording = session.load(entry).recording
        poses = circle.poses(recording.theta_deg)
        for k in (1, 14, 30):
            tip, _ = tool(truth, poses[k])
            assert recording.length_mm[k] == pytest.approx(np.linalg.norm(tip - ball), abs=2e-6)
    assert run("check", out).code == DONE


def test_evaluate_says_what_the_centres_are_and_still_prints_circularity(run, model_file):
    outcome = run("evaluate", SESSION, "--model", model_file)
    assert outcome.code == DONE
    assert (
        "the ball was put up under the spindle in every test: centre deviations there, and rms values with them, "
        in outcome.err
    )
    data = run("evaluate", SESSION, "--model", model_file, "--json").data
    for one in data["runs"]:
        # The model is the truth of this machine; readings have a noise of 0.3 µm, the bar an error of 0.5 µm.
        assert one["after"]["circularity_um"] < 3.0
        assert one["before"]["circularity_um"] > 20.0


def test_evaluate_says_nothing_of_the_sort_about_balls_on_a_plate(run, model_file):
    small = FIXTURES / "sessions" / "small"
    assert "under the spindle" not in run("evaluate", small, "--model", model_file).err
