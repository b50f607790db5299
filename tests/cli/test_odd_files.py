"""Files that no program wrote: a list where keys belong, digits of another script, columns of another size. A message each."""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import zlib

import pytest

from dbbstation.cli import USAGE
from dbbstation.files.places import shipped_folder
from tests.cli.conftest import call

FIXTURES = shipped_folder("fixtures")


@pytest.fixture
def session(tmp_path):
    return shutil.copytree(FIXTURES / "sessions" / "small", tmp_path / "session")


def told(*arguments) -> str:
    outcome = call(*arguments)
    assert outcome.code == 1
    assert "fault of dbbstation" not in outcome.err
    return outcome.err


@pytest.mark.parametrize("text", ["[1, 2]", "word", "null", "12", "- a: 1"])
@pytest.mark.parametrize("command", [["check"], ["session", "list"], ["circles"], ["export", "--out", "e.csv"]])
def test_a_session_file_that_holds_no_keys(session, text, command):
    (session / "session.yaml").write_text(text + "\n", encoding="utf-8")
    assert "session.yaml:1:1: the file holds no `key: value` lines" in told(*command, session)


@pytest.mark.parametrize("value", ["{a: 1}", "[ccw]", "null", "1.5", "[{a: []}]"])
@pytest.mark.parametrize("key", ["direction", "test", "repeat", "file", "state"])
def test_a_run_with_a_value_of_another_kind(session, key, value):
    path = session / "session.yaml"
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(rf"\b{key}: [^,}}]+", f"{key}: {value}", text, count=1), encoding="utf-8")
    assert f"runs[0].{key}" in told("check", session)


@pytest.mark.parametrize("cell", ["１２", "١", "1_0"])
@pytest.mark.parametrize(
    ("head", "rows"),
    [
        ("t_s,position_mm,force_n", ["0.0,{},1", "0.1,1,1"]),
        ("t_s,length_mm", ["0.0,{}", "0.1,150"]),
        ("x_mm,measured,simulated", ["1,{},1"]),
        ("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg", ["{},0,-1008,0,0,0"]),
    ],
)
def test_digits_of_another_script_are_no_number(tmp_path, head, rows, cell):
    file = tmp_path / "file.csv"
    file.write_text("\n".join([head, *rows]).format(cell) + "\n", encoding="utf-8")
    command = ["check", file]
    if "measured" in head:
        command = ["mismatch", file, "--measured", "measured", "--simulated", "simulated"]
    elif "a_deg" in head:
        model = FIXTURES / "models" / "small.yaml"
        command = ["predict", "--model", model, file, "--table", tmp_path / "out.csv"]
    assert f"{file}:2" in told(*command)


@pytest.mark.parametrize("t_s", ["9" * 400, "1e3", "１", "9" * 12])
def test_times_of_a_byte_log_that_are_none(tmp_path, t_s):
    log = tmp_path / "log.txt"
    log.write_text(f"# dbb-byte-log/1\n# instrument: mahr-c1202\n{t_s} < 41\n0.2 < 42\n", encoding="utf-8")
    for more in ([], ["--json"]):
        assert f"{log}:3:1: this line of the byte log cannot be read" in told("instrument", "replay", log, *more)


def scaled(tmp_path, column, power):
    lines = (FIXTURES / "tables" / "axis.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")][:121]
    k = rows[0].index(column)
    for row in rows[1:]:
        row[k] += f"e{power}"
    file = tmp_path / "table.csv"
    file.write_text("\n".join(map(",".join, rows)) + "\n", encoding="utf-8")
    return ["mismatch", file, "--measured", "measured_mm", "--simulated", "simulated_mm", "--no-held-out", "--json"]


@pytest.mark.parametrize("power", [-320, -160, 160, 300])
@pytest.mark.parametrize("column", ["measured_mm", "simulated_mm", "t_s", "load_n"])
def test_a_column_of_numbers_that_no_quantity_has(tmp_path, column, power):
    assert f"{column} goes up to" in told(*scaled(tmp_path, column, power))


@pytest.mark.parametrize(("column", "power"), [("simulated_mm", 3), ("simulated_mm", 12), ("measured_mm", -12)])
def test_a_simulation_in_another_unit(tmp_path, column, power):
    assert "in the same unit" in told(*scaled(tmp_path, column, power))


@pytest.mark.parametrize(("column", "power"), [("load_n", -30), ("load_n", 30), ("oil_temp_c", 9)])
def test_a_variable_in_any_unit_is_compared(tmp_path, column, power):
    outcome = call(*scaled(tmp_path, column, power))
    assert outcome.code == 0, outcome.err


def test_a_direction_without_a_circle_leaves_a_row_of_its_own(session):
    run = session / "runs" / "a-cw-2.csv"
    before = hashlib.sha256(run.read_bytes()).hexdigest()
    lines = run.read_text(encoding="utf-8").splitlines()
    at = next(at for at, line in enumerate(lines) if line.startswith("t_s"))
    assert lines[at].startswith("t_s,length_mm,")
    assert lines[at].endswith(",crc")
    for k in range(at + 1, len(lines)):
        t_s, _, *others, _ = lines[k].split(",")
        body = ",".join([t_s, "150.0", *others])
        lines[k] = f"{body},{zlib.crc32(body.encode()):08x}"
    run.write_text("\n".join(lines) + "\n", encoding="utf-8")
    file = session / "session.yaml"
    after = hashlib.sha256(run.read_bytes()).hexdigest()
    file.write_text(file.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    outcome = call("circles", session, "--findings", "--budget")
    assert outcome.code == 0, outcome.err
    row = next(line.split() for line in outcome.out.splitlines() if line.startswith("a") and " cw " in line)
    assert row[:3] == ["a", "cw", "2"]
    assert set(row[3:]) == {"-"}


def test_half_a_surrogate_pair_is_no_character(tmp_path):
    path = tmp_path / "machine.yaml"
    text = (FIXTURES / "machines" / "reference.yaml").read_text(encoding="utf-8")
    path.write_text(re.sub(r"name: .*", r'name: "\\ud800"', text, count=1), encoding="utf-8")
    assert "half a surrogate pair is no character" in told("check", path)


@pytest.fixture
def circle_of_links(tmp_path):
    path = tmp_path / "loop"
    path.symlink_to("loop")
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["check", "LOOP"],
        ["session", "list", "LOOP"],
        ["session", "reject", "LOOP", "a-ccw-1", "--reason", "x"],
        ["export", "SESSION", "--out", "LOOP"],
        ["circles", "SESSION", "--table", "LOOP"],
        ["history", "LOOP"],
        ["sources", "--source-files", "LOOP"],
        ["instrument", "replay", "LOOP"],
        ["instrument", "list", "LOOP"],
        ["settings", "--settings", "LOOP"],
        ["instrument", "monitor", "--instrument", "mahr-c1202", "--zero-mm", "150", "--port", "LOOP", "--count", "1"],
    ],
    ids=" ".join,
)
def test_links_that_lead_in_a_circle(session, circle_of_links, command):
    outcome = call(*({"LOOP": circle_of_links, "SESSION": session}.get(word, word) for word in command))
    assert outcome.code != 0
    assert "loop" in outcome.err
    assert "fault of dbbstation" not in outcome.err


@pytest.mark.parametrize(
    "command",
    [["circles", "SESSION", "--table", ""], ["export", "SESSION", "--out", ""], ["calibrate", "SESSION", "--out", ""]],
)
def test_an_output_without_a_name(session, command):
    outcome = call(*(session if word == "SESSION" else word for word in command))
    assert outcome.code != 0
    assert "name a file" in outcome.err


def test_a_file_among_sessions_is_named_with_what_leaves_files_out(session):
    """As `shop/*` does, where the log lies beside the sessions."""
    log = session.parent / "dbbstation.log"
    log.write_text("2026-11-23T08:00:00+0000 1 INFO $ dbbstation check session\n", encoding="utf-8")
    assert f"{log}: this file is no session; name session folders; `{log.parent}/*/`" in told("calibrate", session, log)


NO_UTF8 = os.fsdecode(b"\xfc")
"""A byte of Latin-1, as names have that come from an old archive or share."""


@pytest.fixture
def named_otherwise(tmp_path, monkeypatch):
    """Files and a session whose names are not in UTF-8."""
    # What is logged of them would be sent in UTF-8 from the process of the test to that of the report.
    monkeypatch.setattr(logging.root.manager, "disable", logging.CRITICAL)
    shop = tmp_path / f"shop{NO_UTF8}"
    shop.mkdir()
    try:
        shutil.copytree(FIXTURES / "sessions" / "small", shop / f"s{NO_UTF8}")
    except OSError:
        pytest.skip("this file system knows no such names")
    shutil.copy(FIXTURES / "models" / "small.yaml", shop / f"m{NO_UTF8}.yaml")
    shutil.copy(FIXTURES / "sources" / "scale_bow.py", shop / f"own{NO_UTF8}.py")
    return shop


@pytest.mark.parametrize(
    "line",
    [
        "calibrate s? --out out?.yaml --source-files own?.py --json",
        "circles s? --table out?.csv --findings --model m?.yaml",
        "evaluate s? --model m?.yaml",
        "export s? --out out?.csv",
        "history . --table out?.csv --page out?.html",
        "report s? --page out?.html",
        "session list s?",
        "session reject s? a-ccw-1 --reason chip",
        "session seal s?",
    ],
)
def test_names_that_are_not_in_utf8(named_otherwise, monkeypatch, line):
    monkeypatch.chdir(named_otherwise)
    outcome = call(*line.replace("?", NO_UTF8).split())
    assert outcome.code == 0, outcome.err
    written = [path.read_text(encoding="utf-8").replace(r"\\", "\\") for path in named_otherwise.glob("out*")]
    assert not written or any(r"s\xfc" in text for text in written)


def test_a_text_that_is_not_in_utf8_is_refused(session):
    outcome = call("session", "reject", session, "a-ccw-1", "--reason", f"gr{NO_UTF8}n")
    assert outcome.code == USAGE
    assert "'--reason': its character 3 is not written in UTF-8" in outcome.err
