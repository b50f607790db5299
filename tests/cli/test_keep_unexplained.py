"""What has no name is printed as a curve, kept in the model of `diagnose --out`, said to be unknown, and compensated on request."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dbbstation.cli import FAILED
from tests.plant.mechanisms.outsiders import OddGearWobble
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record


@pytest.fixture(scope="module")
def kept(tmp_path_factory, run):
    """A session with a wave of 66.7 mm in strut 3, what was printed, the model that keeps it, and the true machine."""
    folder = tmp_path_factory.mktemp("kept")
    wobble = OddGearWobble(strut=3, turns_per_screw_turn=0.15, amplitude_um=6.0)
    plan = subset(table_ii_plan(51), "abdhjk")
    truth = record(folder / "session", seed=51, plan=plan, mechanisms=[wobble], rate_hz=10.0)
    model = folder / "kept.yaml"
    line = ("diagnose", folder / "session", "--sources", "backlash", "--no-held-out", "--out", model)
    outcome = run(*line)
    assert outcome.code == 0, outcome.err
    return outcome, model, truth


def off_the_line_mm(truth, path):
    """Root mean square distance of the true tool from its mean line, on the way along X."""
    places, poses = {}, []
    for line in path.read_text(encoding="utf-8").splitlines():
        moves = re.fullmatch(r"(?:N\d+ )?(?:G[01] )?((?:[XYZABC]-?[\d.]+ ?)+)(?:F\S+)?", line)
        if moves:
            places |= {axis: float(number) for axis, number in re.findall(r"([XYZABC])(-?[\d.]+)", moves[1])}
            poses.append([places[axis] for axis in "XYZABC"])
    along = np.array(poses)
    wanted = np.linspace(along[0, 0], along[-1, 0], 400)
    dense = np.column_stack([np.interp(wanted, along[:, 0], values) for values in along.T])
    actual = truth.actual_pose(dense)[:, 1:3]
    # Level circles do not show how high all joints lie together: the mean is no error of the form.
    return float(np.sqrt(np.mean(np.sum(np.square(actual - actual.mean(axis=0)), axis=1))))


def test_the_curve_is_printed_with_its_uncertainty_and_that_its_cause_is_unknown(kept):
    outcome, *_ = kept
    assert "An unmodelled effect, organised by strut-length wave, strut 3." in outcome.out
    assert "an error of unknown cause moves the readings by" in outcome.out
    titles = (
        "cause",
        "verdict",
        "probability",
        "log Bayes factor",
        "concealed (R²)",
        "selection frequency",
        "not distinguished from",
    )
    assert any(re.split(r"\s{2,}", line.strip()) == list(titles) for line in outcome.out.splitlines())
    assert "a wave of 66.7" in outcome.out or "a wave of 66.6" in outcome.out
    assert "strut-length wave / mm" in outcome.out
    assert "the model has unexplained-wave, an error whose cause is unknown" in outcome.err


def test_predict_and_compensate_use_it_and_say_so(kept, run, tmp_path):
    _, model, truth = kept
    poses = tmp_path / "poses.csv"
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n", encoding="utf-8")
    predicted = run("predict", "--model", model, poses, "--table", tmp_path / "actual.csv", "--json")
    assert predicted.code == 0, predicted.err
    assert predicted.data["unknown_causes"] == ["unexplained-wave"]
    assert "unexplained-wave, an error whose cause is unknown" in predicted.err
    program = tmp_path / "part.ngc"
    program.write_text("G21 G90\nG0 X-80 Y40 Z-1000 A0 B0 C0\nG1 X80 F1000\nM2\n", encoding="utf-8")
    line = ("compensate", program, "--model", model, "--prefer", "accuracy", "--out")
    plain = run(*line, tmp_path / "plain.ngc")
    assert plain.code == 0, plain.err
    assert "the cause of unexplained-wave is unknown, and it is not corrected" in plain.err
    assert "cause unknown, not corrected 1: unexplained-wave" in (tmp_path / "plain.ngc").read_text(encoding="utf-8")
    done = run(*line, tmp_path / "true.ngc", "--unexplained")
    assert done.code == 0, done.err
    assert "unexplained-wave, an error whose cause is unknown" in done.err
    assert "cause unknown 1: unexplained-wave" in (tmp_path / "true.ngc").read_text(encoding="utf-8")
    # A line that no test travelled, at Y 40 and Z -1000: how far the true machine leaves it.
    away = [off_the_line_mm(truth, tmp_path / name) for name in ("plain.ngc", "true.ngc")]
    assert away[0] > 0.001
    assert away[1] < 0.4 * away[0]


def test_nobody_names_what_is_no_cause(run, tmp_path):
    outcome = run("diagnose", tmp_path, "--sources", "unexplained-by-length")
    assert outcome.code == FAILED
    assert "unexplained-by-length is no cause" in outcome.err
