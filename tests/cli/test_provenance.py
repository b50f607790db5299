"""Every output says where it comes from: program, command, inputs by hash; and the same inputs give the same bytes."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import shlex
import shutil
import xml.etree.ElementTree as ET

import pytest

from dbbstation import __version__
from dbbstation.cli import DONE
from dbbstation.files.places import shipped_folder
from dbbstation.files.provenance import Provenance
from dbbstation.files.yaml.text import load_yaml

PROGRAM = f"dbbstation {__version__}"
SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
POSES = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n"


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def of_session(folder):
    """The recordings have their hashes in the session file; the other two files have none there."""
    return {f"{folder.name}/{name}.yaml": sha256(folder / f"{name}.yaml") for name in ("session", "machine", "plan")}


@pytest.fixture
def poses(tmp_path):
    (tmp_path / "poses.csv").write_text(POSES)
    return tmp_path / "poses.csv"


def test_a_model_and_json(run, tmp_path):
    outcome = run("calibrate", SMALL, "--law-over-time", "--out", tmp_path / "model.yaml", "--json", "--debug")
    assert outcome.code == DONE, outcome.err
    expected = {
        "program": PROGRAM,
        "command": "dbbstation calibrate small --law-over-time",
        "inputs": of_session(SMALL),
    }
    assert outcome.data["provenance"] == expected
    written = load_yaml(tmp_path / "model.yaml", []).data
    assert written["provenance"] == expected
    assert written["format"] == "dbb-model/1"  # three tests do not see all of the machine


def test_the_command_that_is_named_can_be_typed(run, tmp_path, monkeypatch):
    shutil.copytree(SMALL, tmp_path / "small")
    monkeypatch.chdir(tmp_path)
    first = run("calibrate", SMALL, "--sources", "strut-reference-length", "--law-over-time", "--json").data
    assert run(*shlex.split(first["provenance"]["command"])[1:], "--json").data == first


def test_a_program_names_program_command_and_inputs_once(run, tmp_path):
    outcome = run(
        "program",
        "--plan",
        PLAN,
        "--machine",
        MACHINE,
        "--model",
        MODEL,
        "--tests",
        "a",
        "--step-deg",
        "1",
        "--out",
        tmp_path / "o",
    )
    assert outcome.code == DONE, outcome.err
    head = [line for line in (tmp_path / "o" / "a-ccw.ngc").read_text().splitlines() if line.startswith("; ")]
    assert f"; written by: {PROGRAM}" in head
    (command,) = [line for line in head if line.startswith("; command: ")]
    assert command.startswith(
        "; command: dbbstation program --plan table2.yaml --machine reference.yaml --model small.yaml"
    )
    assert {"--tests a", "--step-deg 1.0"} <= {
        " ".join(pair) for pair in zip(command.split(), command.split()[1:], strict=False)
    }
    for path in (PLAN, MACHINE, MODEL):
        assert sum(sha256(path) in line for line in head) == 1


def test_a_long_command_is_cut_into_comments_that_controls_take():
    command = "dbbstation program " + " ".join(f"--tests t{k:03}" for k in range(60))
    said = Provenance(PROGRAM, command, {"a.yaml": "ab" * 32, "b.yaml": "cd" * 32}).comments(
        {"plan file": f"sha256 {'ab' * 32}"}
    )
    assert max(len(f"{title}: {text}") for title, text in said.items()) < 200
    assert " ".join(text for title, text in said.items() if title.startswith("command")) == command
    assert [title for title in said if title.startswith("input")] == ["input b.yaml"]


def test_a_table_stays_plain_csv_with_a_file_beside_it(run, tmp_path, poses):
    out = tmp_path / "out.csv"
    assert run("predict", "--model", MODEL, poses, "--table", out).code == DONE
    with out.open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert {"x_mm", "u_z_mm"} <= row.keys()
    beside = json.loads((tmp_path / "out.csv.provenance.json").read_text())
    assert beside == {
        "program": PROGRAM,
        "command": "dbbstation predict poses.csv --model small.yaml",
        "inputs": {"small.yaml": sha256(MODEL), "poses.csv": sha256(poses)},
    }


@pytest.mark.parametrize("name", ["out.csv", "out.csv.provenance.json"])
def test_neither_file_of_a_table_is_overwritten_without_force(run, tmp_path, poses, name):
    (tmp_path / name).write_text("mine")
    command = ("predict", "--model", MODEL, poses, "--table", tmp_path / "out.csv")
    outcome = run(*command)
    assert outcome.code == 1
    assert f"{name}: the file exists already" in outcome.err
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["poses.csv", name])
    assert run(*command, "--force").code == DONE


def in_svg(data):
    root = ET.fromstring(data)  # noqa: S314 - our own figure
    dublin = "{http://purl.org/dc/elements/1.1/}"
    creator = "".join(next(root.iter(f"{dublin}creator")).itertext()).strip()
    return creator, next(root.iter(f"{dublin}description")).text


def in_png(data):
    texts = {}
    at = 8
    while at < len(data):
        length, kind = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if kind == b"tEXt":
            key, _, text = body.partition(b"\0")
            texts[key.decode()] = text.decode("latin-1")
        at += 12 + length
    return texts["Software"], texts["Description"]


def in_pdf(data):
    told = []
    for key in (b"Creator", b"Subject"):
        found = re.search(rb"/" + key + rb" \((.*?)(?<!\\)\)", data, re.DOTALL)
        assert found
        told.append(re.sub(rb"\\([()\\])", rb"\1", found[1]).decode().replace("\\n", "\n"))
    return tuple(told)


@pytest.mark.parametrize(("ending", "read"), [("svg", in_svg), ("png", in_png), ("pdf", in_pdf)])
def test_a_figure_keeps_it_in_its_metadata(run, tmp_path, ending, read):
    figure = tmp_path / f"figure.{ending}"
    outcome = run("calibrate", SMALL, "--law-over-time", "--figure", figure)
    assert outcome.code == DONE, outcome.err
    creator, told = read(figure.read_bytes())
    assert creator == PROGRAM
    lines = told.splitlines()
    assert lines[0] == "dbbstation calibrate small --law-over-time"
    assert lines[1:] == [f"{name}: sha256 {digest}" for name, digest in of_session(SMALL).items()]


def test_the_same_files_elsewhere_give_the_same_bytes(run, tmp_path, poses):
    for name in ("here", "there"):
        folder = tmp_path / name
        folder.mkdir()
        shutil.copytree(SMALL, folder / "small")
        shutil.copy(poses, folder / "poses.csv")
        done = [
            run("calibrate", folder / "small", "--out", folder / f"{name}.yaml", "--figure", folder / f"{name}.svg"),
            run("predict", "--model", MODEL, folder / "poses.csv", "--table", folder / f"{name}.csv"),
        ]
        assert [outcome.code for outcome in done] == [DONE, DONE]
    for ending in ("yaml", "svg", "csv", "csv.provenance.json"):
        assert (tmp_path / "here" / f"here.{ending}").read_bytes() == (
            tmp_path / "there" / f"there.{ending}"
        ).read_bytes()


def test_two_inputs_of_one_name_are_told_apart(run, tmp_path):
    shutil.copy(MODEL, tmp_path / "small.yaml")
    other = (tmp_path / "small.yaml").read_text().replace("made_up: true", "made_up: false")
    (tmp_path / "small.yaml").write_text(other)
    inputs = run("check", MODEL, tmp_path / "small.yaml", "--json").data["provenance"]["inputs"]
    assert inputs == {"small.yaml": sha256(MODEL), "small.yaml (2)": sha256(tmp_path / "small.yaml")}


def test_options_of_the_settings_stand_in_the_command(run, tmp_path):
    settings = tmp_path / "shop.yaml"
    settings.write_text("format: dbb-settings/1\nprogram: {step_deg: 2.0}\n")
    outcome = run(
        "program",
        "--plan",
        PLAN,
        "--machine",
        MACHINE,
        "--tests",
        "a",
        "--out",
        tmp_path / "o",
        "--json",
        "--settings",
        settings,
    )
    told = outcome.data["provenance"]
    assert told["command"] == "dbbstation program --plan table2.yaml --machine reference.yaml --tests a --step-deg 2.0"
    assert told["inputs"]["shop.yaml"] == sha256(settings)


def test_a_schema_is_a_document_of_its_own(run):
    assert "provenance" not in run("check", "--schema", "dbb-plan/1").data
