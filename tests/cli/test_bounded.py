"""Numbers that are none, cells without an end and counts without an end: bounded, and a message."""

from __future__ import annotations

import json

import click
import pytest

from dbbstation.cli.declared import Finite
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.run_csv import count_in
from tests.cli.conftest import call
from tests.cli.test_help import LINES, found

MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
LONG = "9" * 131_073
"""One more than the csv module of Python takes in a cell."""


@pytest.mark.parametrize("line", LINES)
def test_every_option_that_is_a_number_is_a_finite_one(line):
    for option in found(line.split())[0].params:
        if isinstance(option.type, click.types.FloatParamType):
            assert isinstance(option.type, Finite), option.name


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "NaN", "1e999"])
def test_such_a_number_is_refused_by_the_name_of_its_option(tmp_path, number):
    wanted = ["--plan", "p", "--machine", "m", "--instrument", "i", "--port", "x", "--out", tmp_path / "s"]
    outcome = call("measure", *wanted, "--ambient-temp-c", number)
    assert outcome.code == 2
    assert "--ambient-temp-c" in outcome.err
    assert "not a finite number" in outcome.err
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("quoted", ["", '"'])
@pytest.mark.parametrize(
    ("head", "row", "command"),
    [
        ("x_mm,measured,simulated", "1,{},1", ["mismatch", "--measured", "measured", "--simulated", "simulated"]),
        (
            "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg",
            "{},0,0,0,0,0",
            ["predict", "--model", MODEL, "--table", "actual.csv"],
        ),
        ("t_s,position_mm,force_n", "0.004,{},2", ["check"]),
        ("t_s,length_mm", "0.1,{}", ["check"]),
    ],
)
def test_a_cell_without_an_end_is_named_by_its_line_and_not_printed(tmp_path, head, row, command, quoted):
    file = tmp_path / "table.csv"
    good = row.format("150")
    file.write_text(f"{head}\n{good.replace('0.', '0.0')}\n{row.format(quoted + LONG + quoted)}\n", encoding="utf-8")
    outcome = call(*command, file)
    assert outcome.code == 1
    assert f"{file}:3" in outcome.err
    assert "fault of dbbstation" not in outcome.err
    assert len(outcome.err) < 1000


@pytest.mark.parametrize("text", ["²", "9" * 5000, "-1", "1.0", "", "0x10", "١"])
def test_what_counts_nothing_is_no_count(text):
    assert count_in(text) is None


def test_line_ends_of_windows_are_read_everywhere(tmp_path):
    machine = (shipped_folder("fixtures") / "machines" / "reference.yaml").read_bytes()
    files = {
        "run.csv": b"t_s,length_mm\n" + b"".join(b"0.%d,150\n" % k for k in range(9)),
        "drive.csv": b"t_s,position_mm,force_n\n0.0,0,1\n0.004,0.1,2\n",
        "machine.yaml": machine,
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content.replace(b"\n", b"\r\n"))
    outcome = call("check", *(tmp_path / name for name in files), "--json")
    assert outcome.code == 0, outcome.err
    assert [entry["format"] for entry in json.loads(outcome.out)["files"]] == ["run", "drive", "dbb-machine/1"]
