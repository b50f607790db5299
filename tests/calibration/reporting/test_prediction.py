"""Measured and predicted circularity against circles that are put together by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from dbbstation.calibration.reporting.prediction import predicted_circles, smooth_circularities_um
from dbbstation.cli import cli
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from tests.calibration.reporting.test_evaluation import PHI, observation


def test_form_counts_up_to_thirty_undulations():
    raw = observation("a", 30.0).raw
    theta = np.radians(PHI)
    slow, fast = 1e-3 * np.cos(30 * theta), 1e-3 * np.cos(31 * theta)
    # 30 µm of centre makes a circle of 150 mm out of round by 3 nm.
    assert smooth_circularities_um(raw, [raw.length_mm])[0] == pytest.approx(0.0, abs=0.01)
    assert smooth_circularities_um(raw, [raw.length_mm + slow])[0] == pytest.approx(2.0, abs=0.02)
    assert smooth_circularities_um(raw, [raw.length_mm + fast])[0] == pytest.approx(0.0, abs=0.02)


def test_few_samples_are_no_reason_to_fail():
    raw = observation("a", 0.0).raw
    few = type(raw)(raw.name, raw.circle, raw.t_s[::30], raw.phi_deg[::30], raw.length_mm[::30])
    wave = 1e-3 * np.cos(2 * np.radians(few.phi_deg))
    assert smooth_circularities_um(few, [few.length_mm + wave])[0] == pytest.approx(2.0, abs=0.02)


def test_a_machine_whose_frame_is_stretched_along_x_cuts_an_oval(reference):
    nominal = observation("a", 0.0)
    model = MachineModel(reference, (Fitted(known_sources()["base-joints"], _stretched(reference, 1e-4)),))
    (found,) = predicted_circles(model, [nominal])
    assert found.measured == pytest.approx(0.0, abs=1e-6)
    length = model.bar(nominal.motion()).length_mm
    theta = np.radians(PHI)
    circle = np.column_stack([np.ones(len(PHI)), np.cos(theta), np.sin(theta)])
    deviation = length - circle @ np.linalg.lstsq(circle, length, rcond=None)[0]
    assert found.predicted > 1.0
    assert found.predicted == pytest.approx(1e3 * np.ptp(deviation), abs=0.02)


def _stretched(machine, share):
    shift = np.zeros((6, 3))
    shift[:, 0] = share * machine.hexapod.base_joints_mm[:, 0]
    return shift.ravel()


def test_the_command_prints_both(tmp_path):
    small = str(shipped_folder("fixtures") / "sessions" / "small")
    model = str(tmp_path / "model.yaml")
    assert CliRunner().invoke(cli, ["calibrate", small, "--out", model]).exit_code == 0
    said = CliRunner().invoke(cli, ["evaluate", small, "--model", model])
    assert "circular deviation G up to 30 undulations per revolution" in said.stdout
    answer = json.loads(CliRunner().invoke(cli, ["evaluate", small, "--model", model, "--json"]).stdout)
    for run in answer["runs"]:
        both = run["circularity_30_upr_um"]
        assert both["measured"] <= run["measured"]["circularity_um"] + 0.01
        # What is left of the run bounds how far its circularity can be from the predicted one.
        assert abs(both["predicted"] - both["measured"]) <= run["after"]["circularity_um"] + 0.01
