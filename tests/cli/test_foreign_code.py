"""Code of somebody else may end, exit or recurse: each is one sentence with its place, and never an empty success."""

from __future__ import annotations

import shutil

import pytest

import dbbstation as dbb
from dbbstation.cli import FAILED
from dbbstation.errors import OutputError
from dbbstation.files.places import shipped_folder
from tests.cli.conftest import call

SIMULATORS = shipped_folder("fixtures") / "simulators"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import sys\nsys.exit(0)\n", "own.py:2: cannot be run: SystemExit: 0"),
        ("raise SystemExit\n", "own.py:1: cannot be run: SystemExit"),
        (f"x = {'-' * 100_000}1\n", "own.py: is nested too deeply"),
        ("def f():\n    f()\nf()\n", "own.py:2: cannot be run: RecursionError"),
    ],
)
def test_a_source_file_that_ends_the_program_is_named_with_its_line(tmp_path, text, what):
    own = tmp_path / "own.py"
    own.write_text(text, encoding="utf-8")
    done = call("sources", "--source-files", own)
    assert done.code == FAILED
    assert what in done.err
    assert "fault of dbbstation" not in done.err


def test_a_simulator_that_exits_is_no_empty_success(tmp_path):
    for name in ("pendulum.yaml", "pendulum.csv", "pendulum.py"):
        shutil.copy(SIMULATORS / name, tmp_path / name)
    text = (tmp_path / "pendulum.py").read_text(encoding="utf-8")
    first = "        times, torques ="
    assert text.count(first) == 1
    (tmp_path / "pendulum.py").write_text(
        text.replace(first, f"        raise SystemExit(0)\n{first}"), encoding="utf-8"
    )
    done = call("mismatch", tmp_path / "pendulum.csv", "--simulator", tmp_path / "pendulum.yaml", "--json", "--allow")
    assert (done.code, done.out) == (FAILED, "")
    assert "the simulation failed: SystemExit: 0" in done.err
    assert "pendulum.py:" in done.err


def test_no_task_writes_over_its_own_input_from_python(tmp_path):
    program = tmp_path / "part.ngc"
    text = "G21 G90\nG0 X0 Y0 Z-1008 A0 B0 C0\nG1 X20 F1000\nM2\n"
    program.write_text(text, encoding="utf-8")
    with pytest.raises(OutputError, match="this file was read just now"):
        dbb.compensate(program, MODEL, program, force=True)
    assert program.read_text(encoding="utf-8") == text
