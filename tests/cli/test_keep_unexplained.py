"""`diagnose --keep-unexplained`: what has no name is printed as a curve, kept in the model, used, and said to be unknown."""

from __future__ import annotations

import re

import pytest

from dbbstation.cli import FAILED, USAGE
from tests.plant.mechanisms.outsiders import OddGearWobble
from tests.plant.session import record


@pytest.fixture(scope="module")
def kept(tmp_path_factory, run):
    """A session with a wave of 66.7 mm in strut 3, what was printed, and the model that keeps it."""
    folder = tmp_path_factory.mktemp("kept")
    wobble = OddGearWobble(strut=3, turns_per_screw_turn=0.15, amplitude_um=6.0)
    record(folder / "session", seed=51, mechanisms=[wobble], rate_hz=10.0)
    model = folder / "kept.yaml"
    line = ("diagnose", folder / "session", "--sources", "backlash", "--out", model, "--keep-unexplained")
    outcome = run(*line)
    assert outcome.code == 0, outcome.err
    return outcome, model


def test_the_curve_is_printed_with_its_uncertainty_and_that_its_cause_is_unknown(kept):
    outcome, _ = kept
    assert "An unmodelled effect, organised by strut-length wave, strut 3." in outcome.out
    assert "cause unknown:" in outcome.out
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
    _, model = kept
    poses = tmp_path / "poses.csv"
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n", encoding="utf-8")
    predicted = run("predict", "--model", model, poses, "--table", tmp_path / "actual.csv", "--json")
    assert predicted.code == 0, predicted.err
    assert predicted.data["unknown_causes"] == ["unexplained-wave"]
    assert "unexplained-wave, an error whose cause is unknown" in predicted.err
    program = tmp_path / "part.ngc"
    program.write_text("G21 G90\nG0 X0 Y0 Z-1008 A0 B0 C0\nG1 X20 F1000\nM2\n", encoding="utf-8")
    done = run("compensate", program, "--model", model, "--prefer", "accuracy", "--out", tmp_path / "true.ngc")
    assert done.code == 0, done.err
    assert "unexplained-wave, an error whose cause is unknown" in done.err
    assert "cause unknown 1: unexplained-wave" in (tmp_path / "true.ngc").read_text(encoding="utf-8")


def test_it_needs_a_model_to_be_kept_in(run, tmp_path):
    outcome = run("diagnose", tmp_path, "--keep-unexplained")
    assert outcome.code == USAGE
    assert "--out" in outcome.err


def test_nobody_names_what_is_no_cause(run, tmp_path):
    outcome = run("diagnose", tmp_path, "--sources", "unexplained-by-length")
    assert outcome.code == FAILED
    assert "unexplained-by-length is no cause" in outcome.err
