"""A model whose fit said that physics is missing says so wherever its numbers are used."""

from __future__ import annotations

import csv

import pytest

from dbbstation.files.places import shipped_folder
from tests.cli.test_report_command import Page

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MISFIT = "misfit: {probability: 0.0, rms_um: 3.25, missing_physics: true}"
SAID = "the residual exceeds noise and mountings by 3.25 µm rms (probability by chance below 1e-99)"


def model_that(folder, said):
    path = folder / "model.yaml"
    text = MODEL.read_text("utf-8").replace("report: {", f"report: {{{said}, ")
    path.write_text(text, "utf-8")
    return path


@pytest.fixture
def failed(tmp_path):
    return model_that(tmp_path, MISFIT)


def test_predict_says_it(failed, run, tmp_path):
    poses = tmp_path / "poses.csv"
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n", encoding="utf-8")
    done = run("predict", "--model", failed, poses, "--table", tmp_path / "actual.csv", "--json")
    assert done.code == 0, done.err
    assert SAID in done.err
    assert [SAID in text for text in done.data["model_warnings"]] == [True]
    table = list(csv.DictReader((tmp_path / "actual.csv").read_text("utf-8").splitlines()))
    assert SAID in table[0]["model_warning"]


def test_compensate_says_it(failed, run, tmp_path):
    program = tmp_path / "part.ngc"
    program.write_text("G21 G90\nG0 X0 Y0 Z-1008 A0 B0 C0\nG1 X20 F1000\nM2\n", encoding="utf-8")
    out = tmp_path / "true.ngc"
    done = run("compensate", program, "--model", failed, "--prefer", "accuracy", "--out", out, "--json")
    assert done.code == 0, done.err
    assert SAID in done.err
    assert [SAID in text for text in done.data["model_warnings"]] == [True]
    assert "model warning 1: physics is missing" in out.read_text("utf-8")


def test_programs_say_it(failed, run, tmp_path):
    given = ("--plan", PLAN, "--machine", MACHINE, "--model", failed, "--tests", "a", "--prefer", "accuracy")
    done = run("program", *given, "--out", tmp_path / "nc", "--json")
    assert done.code == 0, done.err
    assert SAID in done.err
    assert [SAID in text for text in done.data["model_warnings"]] == [True]
    texts = [path.read_text("utf-8") for path in (tmp_path / "nc").iterdir()]
    assert texts
    assert all("model warning 1: physics is missing" in text for text in texts)


def test_evaluate_says_it(failed, run):
    done = run("evaluate", SMALL, "--model", failed)
    assert done.code == 0, done.err
    assert SAID in done.err


def page_of(run, model, folder):
    out = folder / "report.html"
    done = run("report", SMALL, "--model", model, "--page", out, "--json")
    assert done.code == 0, done.err
    return Page(out.read_text("utf-8")).text, done.data


def test_the_report_says_it_on_page_1_and_beside_the_parameters(failed, run, tmp_path):
    text, data = page_of(run, failed, tmp_path)
    first, rest = text.split("serial number", 1)
    assert "The model failed" in first
    assert SAID in first
    assert SAID in rest
    assert rest.index(SAID) < rest.index("A dash where the model")
    assert [SAID in warning for warning in data["model_warnings"]] == [True]
    assert any("dbbstation diagnose" in step for step in data["verdict"]["to_do"])
    assert not any("dbbstation calibrate" in step for step in data["verdict"]["to_do"])


def test_causes_that_are_not_decided_stand_on_page_1(run, tmp_path):
    model = model_that(tmp_path, "diagnosis: {ambiguous: [[gravity, strut-weight]]}")
    text, _ = page_of(run, model, tmp_path)
    assert "cannot tell gravity from strut-weight" in text.split("serial number", 1)[0]


def test_a_limit_that_the_diagnosis_reached_stands_on_page_1_and_beside_the_parameters(run, tmp_path):
    limit = "The joint fit still moved at its last step. Values and uncertainties are those of that step."
    model = model_that(tmp_path, f'diagnosis: {{limits: ["{limit}"]}}')
    text, data = page_of(run, model, tmp_path)
    assert [limit in part for part in text.split("serial number", 1)] == [True, True]
    assert data["model_warnings"] == [limit[:-1]]


def test_a_model_that_is_sound_has_no_warning(run, tmp_path):
    model = model_that(tmp_path, "misfit: {probability: 0.4, rms_um: 0.1, missing_physics: false}")
    text, data = page_of(run, model, tmp_path)
    assert "physics is missing" not in text
    assert "The model failed" not in text
    assert data["model_warnings"] == []
