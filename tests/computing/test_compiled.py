"""Compiled loops where there is no folder that their code can be kept in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dbbstation
from dbbstation.computing import compiled as module
from dbbstation.computing.compiled import NotKeptWarning, compiled
from dbbstation.files.places import shipped_folder


def of_no_file(name):
    place = {}
    exec(compile(f"def {name}(a, b):\n    return a + b\n", "<nowhere>", "exec"), place)  # noqa: S102 - written here
    return place[name]


def test_a_loop_runs_without_a_folder_and_this_is_said_once():
    module._say_not_kept.cache_clear()
    first, second = compiled(of_no_file("first")), compiled(of_no_file("second"))
    with pytest.warns(NotKeptWarning, match="NUMBA_CACHE_DIR") as told:
        assert (first(1, 2), second(3.0, 4.5)) == (3, 7.5)
    assert len(told) == 1


@pytest.fixture
def read_only(tmp_path):
    """A copy of the package in which no folder for compiled code can be made, by root neither, and a home of the same kind."""
    package = tmp_path / "installed" / "dbbstation"
    shutil.copytree(Path(dbbstation.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("fixtures", "protocols"):
        (package / folder).symlink_to(shipped_folder(folder))
    for folder in [package, *(path for path in package.rglob("*") if path.is_dir() and not path.is_symlink())]:
        (folder / "__pycache__").write_text("no folder")
    own = {name: value for name, value in os.environ.items() if name not in {"NUMBA_CACHE_DIR", "XDG_CACHE_HOME"}}
    nowhere = str(package / "__pycache__" / "home")
    return own | {"PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1", "HOME": nowhere}


@pytest.mark.slow  # compiles, as the command has to
def test_a_command_of_an_install_that_cannot_be_written_to_runs_and_says_so(read_only, tmp_path):
    (tmp_path / "poses.csv").write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n", encoding="utf-8")
    model = shipped_folder("fixtures") / "models" / "small.yaml"
    command = ["predict", "--model", str(model), "poses.csv", "--table", "actual.csv"]
    where = "import dbbstation; print(dbbstation.__file__)"
    asked = {"env": read_only, "cwd": tmp_path, "capture_output": True, "text": True}
    assert str(tmp_path) in subprocess.run([sys.executable, "-c", where], check=False, **asked).stdout
    done = subprocess.run([sys.executable, "-m", "dbbstation", *command], check=False, **asked)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("note: there is no folder that compiled loops can be kept in") == 1
    assert "Warning" not in done.stderr
    assert (tmp_path / "actual.csv").exists()
