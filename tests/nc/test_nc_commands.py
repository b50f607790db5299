"""`dbbstation program` and `dbbstation compensate`, as people call them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dbbstation.cli.programs import compensate, program
from dbbstation.errors import InputError, ModelError, OutputError, StationError, TravelError
from dbbstation.files.formats.model import write_model
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel

PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PART = "G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n"


def run(command, *arguments):
    result = CliRunner().invoke(command, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture
def model_file(tmp_path, crooked):
    path = tmp_path / "model.yaml"
    rows = tuple(
        (fitted.source.name, "", parameter.name)
        for fitted in crooked.sources
        for parameter in fitted.source.parameters(crooked.machine)
    )
    identified = IdentifiedModel(crooked, rows, 1e-6 * np.eye(len(rows)), sessions={"first": "ab" * 32})
    write_model(path, identified)
    return path


def test_all_programs_of_a_plan(tmp_path):
    result = run(program, "--plan", PLAN, "--machine", MACHINE, "--out", tmp_path / "nc", "--json")
    said = json.loads(result.stdout)
    names = sorted(path.name for path in (tmp_path / "nc").iterdir())
    assert names == sorted(f"{test}-{way}.ngc" for test in "abcdefghijklmno" for way in ("ccw", "cw"))
    assert len(said["programs"]) == 30
    for each in said["programs"]:
        assert hashlib.sha256(Path(each["file"]).read_bytes()).hexdigest() == each["sha256"]
        assert each["points"] == 4505
        assert each["greatest_correction_um"] is None


def test_headers_name_model_and_sessions_by_hash(tmp_path, model_file):
    arguments = ["--plan", PLAN, "--machine", MACHINE, "--model", model_file, "--tests", "c", "--json"]
    said = json.loads(run(program, *arguments, "--out", tmp_path / "one").stdout)
    text = (tmp_path / "one" / "c-cw.ngc").read_text()
    digest = hashlib.sha256(model_file.read_bytes()).hexdigest()
    assert said["model_sha256"] == digest
    assert f"; model file: model.yaml, sha256 {digest}\n" in text
    assert f"; session first: sha256 {'ab' * 32}\n" in text
    assert "; ball-bar run: test c cw\n" in text
    assert "; plan: Table II, fifteen circles\n" in text
    assert said["programs"][0]["greatest_correction_um"] > 10.0
    run(program, *arguments, "--out", tmp_path / "two")
    assert (tmp_path / "two" / "c-cw.ngc").read_text() == text


def test_nothing_is_overwritten_without_force(tmp_path):
    arguments = ["--plan", PLAN, "--machine", MACHINE, "--out", tmp_path / "nc"]
    run(program, *arguments, "--tests", "b")
    (tmp_path / "nc" / "b-cw.ngc").write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        run(program, *arguments)
    assert sorted(path.name for path in (tmp_path / "nc").iterdir()) == ["b-ccw.ngc", "b-cw.ngc"]
    assert (tmp_path / "nc" / "b-cw.ngc").read_text() == "mine"
    run(program, *arguments, "--tests", "b", "--force")
    assert (tmp_path / "nc" / "b-cw.ngc").read_text() != "mine"


def test_a_circle_outside_the_travel_leaves_nothing_on_disk(tmp_path):
    high = tmp_path / "plan.yaml"
    high.write_text(PLAN.read_text().replace("[100.0, 100.0, 280.0]", "[100.0, 160.0, 280.0]"))
    for force in ([], ["--force"]):
        with pytest.raises(TravelError, match="test n ccw"):
            run(program, "--plan", high, "--machine", MACHINE, "--out", tmp_path / "nc", *force)
    assert not (tmp_path / "nc").exists()


def test_an_unknown_test_and_an_unknown_dialect_are_named(tmp_path):
    arguments = ["--plan", PLAN, "--machine", MACHINE, "--out", tmp_path / "nc"]
    with pytest.raises(StationError, match="no test z"):
        run(program, *arguments, "--tests", "z")
    with pytest.raises(StationError, match="'klingon'"):
        run(program, *arguments, "--dialect", "klingon")


def test_a_model_of_another_machine_is_refused(tmp_path, model_file):
    other = tmp_path / "machine.yaml"
    other.write_text(MACHINE.read_text().replace("732.203103097", "732.303103097"))
    with pytest.raises(ModelError, match="another nominal machine"):
        run(program, "--plan", PLAN, "--machine", other, "--model", model_file, "--out", tmp_path / "nc")


def test_compensate_writes_one_file_and_says_what(tmp_path, model_file):
    part, out = tmp_path / "part.ngc", tmp_path / "true.ngc"
    part.write_text(PART)
    said = json.loads(run(compensate, part, "--model", model_file, "--out", out, "--json").stdout)
    assert said["programs"][0]["sha256"] == hashlib.sha256(out.read_bytes()).hexdigest()
    assert 0.0 < said["programs"][0]["chord_error_um"] <= 0.1
    assert out.read_text().startswith("; machine: PM-600-like reference\n; program file: part.ngc, sha256 ")
    assert str(tmp_path) not in out.read_text()
    with pytest.raises(OutputError, match="exists already"):
        run(compensate, part, "--model", model_file, "--out", out)


def test_what_the_model_knows_is_set_against_the_chord_asked_for(tmp_path, model_file):
    """Each of 24 coordinates and lengths is known within 1 µm: the tip within a few."""
    part = tmp_path / "part.ngc"
    part.write_text(PART)
    arguments = [part, "--model", model_file, "--force", "--out", tmp_path / "true.ngc"]
    (told,) = json.loads(run(compensate, *arguments, "--chord-um", "0.2", "--json").stdout)["programs"]
    assert told["chord_asked_um"] == pytest.approx(0.2)
    assert 1.0 < told["model_uncertainty_um"] < 10.0
    text = run(compensate, *arguments, "--chord-um", "0.2").output
    assert "the chord error asked for is 0.2 µm: moves are split finer than the model knows them" in text
    assert "finer than" not in run(compensate, *arguments, "--chord-um", "50").output
    assert "; standard uncertainty of the model along the path " in (tmp_path / "true.ngc").read_text()


@pytest.mark.parametrize("command", ["program", "compensate"])
def test_the_limit_of_corrections_is_an_option_within_limits(tmp_path, model_file, command):
    part = tmp_path / "part.ngc"
    part.write_text(PART)
    arguments = {
        "program": [program, "--plan", PLAN, "--machine", MACHINE, "--tests", "a"],
        "compensate": [compensate, part],
    }[command]
    arguments += ["--model", model_file, "--out", tmp_path / "out"]
    with pytest.raises(StationError, match=r"more than 0\.01 mm"):
        run(*arguments, "--largest-correction-mm", "0.01")
    assert not (tmp_path / "out").exists()
    assert run(*arguments, "--largest-correction-mm", "11").exit_code == 2
    assert run(*arguments, "--largest-correction-mm", "2").exit_code == 0


def test_no_option_lifts_the_travel(tmp_path, model_file):
    part = tmp_path / "part.ngc"
    part.write_text(PART.replace("X100", "X400"))
    with pytest.raises(TravelError):
        run(
            compensate,
            part,
            "--model",
            model_file,
            "--out",
            tmp_path / "o.ngc",
            "--force",
            "--largest-correction-mm",
            "10",
        )


def test_a_part_that_leaves_the_travel_leaves_nothing_on_disk(tmp_path, model_file):
    part, out = tmp_path / "part.ngc", tmp_path / "true.ngc"
    part.write_text(PART.replace("X100", "X400"))
    with pytest.raises(TravelError, match=r"part\.ngc:3"):
        run(compensate, part, "--model", model_file, "--out", out, "--force")
    assert not out.exists()


def test_a_start_pose_lets_a_program_begin_anywhere(tmp_path, model_file):
    part, out = tmp_path / "part.xyz", tmp_path / "true.ngc"
    part.write_text("G91 G1 X10 F100\nM2\n")
    with pytest.raises(StationError, match="no NC dialect"):
        run(compensate, part, "--model", model_file, "--out", out)
    with pytest.raises(InputError, match="the program does not state the place of"):
        run(compensate, part, "--written-in", "linuxcnc", "--model", model_file, "--out", out)
    run(compensate, part, "--written-in", "linuxcnc", "--start", "0,0,-1000,0,0,0", "--model", model_file, "--out", out)
    moves = [line for line in out.read_text().splitlines() if line.startswith("G1 ")]
    assert len(moves) == 1
    assert float(moves[0].split()[1].removeprefix("X")) == pytest.approx(10.0, abs=1.0)
    assert run(compensate, part, "--start", "1,2", "--model", model_file, "--out", out).exit_code == 2


def test_subprograms_and_skipped_lines_are_declared(tmp_path, model_file):
    part, out, folder = tmp_path / "part.ngc", tmp_path / "true.ngc", tmp_path / "subs"
    folder.mkdir()
    (folder / "side.ngc").write_text("o<side> sub\nG1 X#1 F100\no<side> endsub\n")
    part.write_text("G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\no<side> call [10]\n/G1 Y20\nM2\n")
    declared = ["--subprograms", folder, "--model", model_file, "--out", out]
    with pytest.raises(InputError, match=r"part\.ngc:4:1: .*--block-delete on, or off"):
        run(compensate, part, *declared)
    lengths = []
    for switch in ("on", "off"):
        run(compensate, part, *declared, "--block-delete", switch, "--force")
        assert "subprogram side" in out.read_text()
        lengths.append(sum(line.startswith("G1") for line in out.read_text().splitlines()))
    assert 0 < lengths[0] < lengths[1]


def test_bad_files_are_told(tmp_path, model_file):
    with pytest.raises(InputError, match="no such file"):
        run(compensate, tmp_path / "none.ngc", "--model", model_file, "--out", tmp_path / "x.ngc")


def test_comments_may_be_in_any_letters(tmp_path, model_file):
    for number, letters in enumerate(("cp1252", "utf-8-sig", "utf-16", "latin-1")):
        part, out = tmp_path / f"{number}.ngc", tmp_path / f"{number}-true.ngc"
        text = "G21 G90 (Fräser Ø 6 µm)\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X10 F100\nM2\n"
        part.write_bytes(text.replace("\n", "\r" if number == 1 else "\n").encode(letters))
        run(compensate, part, "--model", model_file, "--out", out)
        assert "; Fr?ser ? 6 um" in out.read_text()


SHOP = "%\nO0001 (PART)\nG21\nT1 M6\nG0 G90 G54 X0. Y0. S800 M3\nG43 H1 Z5.\nG1 Z-1. F100\nX10.\nG91 G28 Z0.\nG90\nM30\n%\n"


def test_offsets_and_lengths_come_from_linuxcncs_files_and_the_command(tmp_path, model_file):
    part, out = tmp_path / "part.ngc", tmp_path / "true.ngc"
    part.write_text(SHOP)
    (tmp_path / "linuxcnc.var").write_text(
        "5163\t-950.0\n5210\t0\n5211\t9.0\n5220\t1\n5221\t20.000000\n5222\t-5.0\n5223\t-1000.0\n"
    )
    (tmp_path / "tool.tbl").write_text("T1 P1 Z12.5 D6 ;end mill\nT2 P2 Z+3.5\n")
    files = ("--parameters", tmp_path / "linuxcnc.var", "--tools", tmp_path / "tool.tbl")
    common = (part, "--model", model_file, "--out", out, "--force", "--angles-deg", "0,0,0")
    with pytest.raises(InputError, match=r"part\.ngc:6:5: the length of tool 1 is not known"):
        run(compensate, *common)
    run(compensate, *common, *files)
    text = out.read_text()
    for said in ("work system G54: X20 Y-5 Z-1000", "the length of tool 1: Z12.5", "after a new touch-off"):
        assert said in text
    lines = text.splitlines()
    first = next(line for line in lines if line.startswith("G0 "))
    assert [word[0] for word in first.split()] == [
        "G",
        "X",
        "Y",
        "A",
        "B",
        "C",
    ]  # where Z stands is not known before G43
    cuts = [line for line in lines if line.startswith("G1 ")]
    np.testing.assert_allclose([float(cuts[0].split("Z")[1].split()[0])], [-1.0], atol=0.5)
    run(compensate, *common, *files, "--offsets", "G54=0,0,-990", "--tool-lengths-mm", "1=10")
    assert "work system G54: Z-990" in out.read_text()
    assert "the length of tool 1: Z10" in out.read_text()
    assert run(compensate, *common, "--offsets", "G54=0,0").exit_code == 2
    (tmp_path / "tool.tbl").write_text("tools of the shop\n")
    with pytest.raises(InputError, match=r"tool\.tbl:1:1: this is not a line of a tool table"):
        run(compensate, *common, *files)


@pytest.mark.parametrize("command", [program, compensate])
def test_help_has_examples(command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert "Examples:" in result.output


@pytest.mark.parametrize(("units", "notes"), [("G21 ", 0), ("", 1)])
def test_a_program_without_units_is_taken_for_millimetres_and_that_is_said(units, notes, tmp_path, model_file):
    part, out = tmp_path / "part.ngc", tmp_path / "true.ngc"
    part.write_text(f"{units}G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n")
    result = run(compensate, part, "--model", model_file, "--out", out)
    assert result.stderr.count("neither G20 nor G21: its lengths are taken for millimetres") == notes
    assert "G21 G90" in out.read_text()
