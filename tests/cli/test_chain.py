"""From recordings to a compensated NC path on the command line, and what is printed on the way."""

from __future__ import annotations

import csv
import hashlib
import json

import numpy as np
import pytest

from dbbstation.cli import DONE
from dbbstation.files.places import shipped_folder

pytestmark = pytest.mark.usefixtures("answers_kept")

FIGURES = {"centre_deviation_um", "mean_radial_error_um", "circularity_um"}
WHEN = ("before", "after")


def table_rows(text):
    for line in text.splitlines():
        cells = line.split()
        if len(cells) == 9 and cells[1] in {"ccw", "cw"}:
            yield (cells[0], cells[1], int(cells[2])), [float(cell) for cell in cells[3:]]


def agree(printed, data):
    rows = dict(table_rows(printed))
    assert len(rows) == len(data["runs"])
    for run in data["runs"]:
        # Beside predictions the circular deviation is that of low-passed readings, of which the JSON has both.
        bent = run.get("circularity_30_upr_um") or {when: run[when]["circularity_um"] for when in WHEN}
        figures = ("centre_deviation_um", "mean_radial_error_um")
        expected = [*(run[when][figure] for figure in figures for when in WHEN), *(bent[when] for when in WHEN)]
        assert rows[run["test"], run["direction"], run["repeat"]] == pytest.approx(expected, abs=0.0501)


def printed_number(text, label):
    line = next(line for line in text.splitlines() if line.startswith(label))
    return float(line.removeprefix(label).split()[0])


def test_calibrate_prints_json_and_nothing_else(calibrated):
    model, outcome = calibrated
    data = outcome.data
    assert data.keys() >= {
        "runs",
        "parameters_identified",
        "directions_lost",
        "residual_rms_um",
        "residual_within_mounting_rms_um",
        "sources",
        "measurement_effects",
    }
    assert len(data["runs"]) == 30
    for run in data["runs"]:
        assert run.keys() >= {"test", "direction", "repeat", "before", "after"}
        for when in ("before", "after"):
            assert run[when].keys() == FIGURES | {"centre_deviation_from_first_um"}
    assert data["parameters_identified"] == 24
    assert data["directions_lost"] == []
    assert {source["name"] for source in data["sources"]} == {"strut-reference-length", "base-joints"}
    assert {effect["name"] for effect in data["measurement_effects"]} == {
        "mounting",
        "ball-coordinate",
        "bar-offset",
        "run-start",
    }
    assert model.exists()


def test_calibrate_prints_the_same_numbers_as_a_table(run, calibrated, fifteen):
    data = calibrated[1].data
    outcome = run("calibrate", fifteen)
    assert outcome.code == DONE
    agree(outcome.out, data)
    assert "24 parameters identified" in outcome.out
    assert "not visible" not in outcome.out
    for label, key in (
        ("nominal machine leaves", "nominal_rms_um"),
        ("model leaves", "residual_rms_um"),
        ("... within each mounting", "residual_within_mounting_rms_um"),
        ("noise of one reading", "noise_um"),
    ):
        assert printed_number(outcome.out, label) == pytest.approx(data[key], abs=0.00501)
    struts = [line.split() for line in outcome.out.splitlines() if line.startswith("strut-reference-length")]
    lengths = next(s["parameters"] for s in data["sources"] if s["name"] == "strut-reference-length")
    for cells, number in zip(struts, lengths.values(), strict=True):
        assert number["unit"] == "mm"
        u_um = 1e3 * number["uncertainty"]
        assert list(map(float, cells[3:6])) == pytest.approx([1e3 * number["value"], u_um, 2.0 * u_um], abs=0.0501)


def test_calibration_finds_the_errors_that_were_drawn(calibrated, errors):
    parameters = next(s["parameters"] for s in calibrated[1].data["sources"] if s["name"] == "strut-reference-length")
    found = [number["value"] for number in parameters.values()]
    assert found == pytest.approx(errors.length_mm, abs=0.01)


def test_level_circles_say_in_words_what_they_do_not_see(run, elsewhere):
    outcome = run("calibrate", elsewhere)
    assert outcome.code == DONE
    assert "not visible to these tests, held at nominal: all six base joints together along Z" in outcome.out


def test_a_test_can_be_left_out(run, elsewhere, model):
    outcome = run("evaluate", elsewhere, "--model", model, "--exclude", "h", "--json")
    assert {run["test"] for run in outcome.data["runs"]} == {"d", "k"}


def test_evaluate_predicts_other_places(run, elsewhere, model):
    told, printed = (run("evaluate", elsewhere, "--model", model, *extra) for extra in (["--json"], []))
    assert (told.code, printed.code) == (DONE, DONE)
    data = told.data
    assert {"runs", "residual_rms_um", "nominal_rms_um", "flatness_um", "parallelism_um"} <= data.keys()
    assert data["nominal_rms_um"] > 20
    assert data["residual_rms_um"] < 5
    assert data["held_out"] is True
    assert (
        f"Use this model: yes, near these circles, if {data['residual_rms_um']:.2f} µm rms are good enough"
        in printed.out
    )
    agree(printed.out, data)
    assert printed_number(printed.out, "model leaves") == pytest.approx(data["residual_rms_um"], abs=0.00501)
    assert printed_number(printed.out, "flatness") == pytest.approx(data["flatness_um"], abs=0.0501)
    assert printed_number(printed.out, "parallelism along X") == pytest.approx(data["parallelism_um"], abs=0.0501)


def test_circles_of_the_fit_do_not_tell_whether_to_use_a_model(run, fifteen, model):
    printed = run("evaluate", fifteen, "--model", model, "--tests", "a", "--tests", "b")
    assert "Use this model: cannot tell. It was made of these circles" in printed.out


def test_simulated_recordings_are_those_of_the_model(run, tmp_path, fifteen, model):
    simulated = run("simulate", "--model", model, fifteen / "plan.yaml", "--out", tmp_path / "again")
    assert simulated.code == DONE
    assert run("check", tmp_path / "again").code == DONE
    data = run("evaluate", tmp_path / "again", "--model", model, "--json").data
    assert data["residual_rms_um"] < 0.001
    assert data["nominal_rms_um"] > 20


def test_predict_adds_uncertainties_and_keeps_other_columns(run, tmp_path, model):
    header = "name,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg"
    (tmp_path / "in.csv").write_text(f"{header}\nmiddle,0,0,-1008,0,0,0\ncorner,100,100,-1150,-10,10,0\n")
    files = [tmp_path / "in.csv", "--table", tmp_path / "out.csv"]
    outcome = run("predict", "--model", model, *files, "--json")
    assert outcome.code == DONE
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"]
    names += ["u_x_mm", "u_y_mm", "u_z_mm", "u_not_known_because", "name"]
    assert list(rows[0]) == names
    assert [row["name"] for row in rows] == ["middle", "corner"]
    commanded = np.array([[0, 0, -1008], [100, 100, -1150]])
    actual = np.array([[float(row[name]) for name in names[:3]] for row in rows])
    error_um = 1e3 * np.linalg.norm(actual - commanded, axis=1).max()
    assert outcome.data["greatest_error_um"] == pytest.approx(error_um, abs=1e-4)
    assert 0 < outcome.data["greatest_uncertainty_um"] < 10
    assert (outcome.data["poses"], outcome.data["file"]) == (2, str(tmp_path / "out.csv"))


def test_programs_name_their_origin_and_are_said_in_json(run, tmp_path, fifteen, model):
    session = ["--plan", fifteen / "plan.yaml", "--machine", fifteen / "machine.yaml", "--tests", "d"]
    outcome = run("program", *session, "--model", model, "--out", tmp_path / "nc", "--json")
    assert outcome.code == DONE
    assert sorted(path.name for path in (tmp_path / "nc").iterdir()) == ["d-ccw.ngc", "d-cw.ngc"]
    model_hash = hashlib.sha256(model.read_bytes()).hexdigest()
    assert outcome.data["model_sha256"] == model_hash
    for program in outcome.data["programs"]:
        content = (tmp_path / "nc" / program["file"].rpartition("/")[2]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == program["sha256"]
        assert program["points"] > 1500
        assert program["greatest_correction_um"] > 10
        head = content.decode().split("G21")[0]
        assert model_hash in head
        assert hashlib.sha256((fifteen / "session.yaml").read_bytes()).hexdigest() in head


def test_any_program_can_be_compensated(run, tmp_path, model):
    (tmp_path / "part.ngc").write_text("G21 G90 G94\nG1 X0 Y0 Z-1000 A0 B0 C0 F1000\nG1 X50\nG2 X0 Y0 I-25 J0\nM2\n")
    files = [tmp_path / "part.ngc", "--out", tmp_path / "true.ngc"]
    outcome = run("compensate", *files, "--model", model, "--prefer", "accuracy", "--json")
    assert outcome.code == DONE
    (program,) = outcome.data["programs"]
    assert program["file"] == str(tmp_path / "true.ngc")
    assert program["greatest_correction_um"] > 10
    assert program["chord_error_um"] <= 0.2


def test_check_lists_what_is_good_and_what_is_not(run, tmp_path, fifteen, model):
    (tmp_path / "bad.yaml").write_text("format: dbb-machine/1\nname: x\nrotaton: Rx(A) Ry(B) Rz(C)\n")
    outcome = run("check", fifteen, model, tmp_path / "bad.yaml", "--json")
    assert outcome.code == 1
    assert [file["ok"] for file in outcome.data["files"]] == [True, True, False]
    assert any("did you mean `rotation`" in problem["remedy"] for problem in outcome.data["problems"])
    assert all(problem["line"] > 0 for problem in outcome.data["problems"])


def test_every_shipped_file_is_good(run):
    files = [*(shipped_folder("protocols") / "plans").glob("*.yaml"), *shipped_folder("fixtures").glob("*/*.yaml")]
    outcome = run("check", *files, shipped_folder("fixtures") / "sessions" / "small")
    assert (outcome.code, outcome.err) == (DONE, "")
    assert len(outcome.out.splitlines()) == len(files) + 1


@pytest.mark.parametrize(
    "arguments", [["instrument", "list"], ["instrument", "ports"], ["instrument", "list", "streaming-encoder"]]
)
def test_lists_are_json_too(run, arguments):
    outcome = run(*arguments, "--json")
    assert outcome.code == DONE
    assert outcome.data


def test_recordings_made_elsewhere(run, recordings, tmp_path):
    sessions = recordings / "sessions"
    fitted = run("calibrate", sessions / "first-light", "--out", tmp_path / "model.yaml", "--json")
    assert fitted.code == DONE, fitted.err
    assert fitted.data["residual_within_mounting_rms_um"] < 0.52
    checked = run("evaluate", sessions / "first-light-check", "--model", tmp_path / "model.yaml", "--json")
    assert checked.data["residual_rms_um"] < 1.65
    assert json.loads(checked.out)["runs"]
