"""A folder that somebody handed over holds modules: none of them is ever executed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.service.work import BackgroundWork, Call, WorkProgress
from dbbstation.system.children import python_module
from dbbstation.system.processes import each

SMALL = shipped_folder("fixtures") / "sessions" / "small"

NAMES = (
    *(
        "random",
        "json",
        "logging",
        "socket",
        "signal",
        "struct",
        "tempfile",
        "threading",
        "multiprocessing",
        "subprocess",
    ),
    *("pickle", "types", "typing", "enum", "datetime", "decimal", "csv", "hashlib", "shutil", "pathlib", "statistics"),
    *("numpy", "scipy", "numba", "pydantic", "click", "rich", "textual", "serial", "matplotlib", "ruamel", "jinja2"),
    *("yaml", "psutil", "platformdirs", "threadpoolctl", "dbbstation", "tests", "sitecustomize", "usercustomize"),
)
"""Modules of Python, of what the program needs, and of the program; those that Python itself loads when it starts, too."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A session among modules that leave a file where they are executed."""
    session = Path(shutil.copytree(SMALL, tmp_path / "session"))
    for place in (tmp_path, session):
        for name in NAMES:
            (place / f"{name}.py").write_text(
                f"from os import open as o; o({str(tmp_path / 'executed')!r}, 65)\nraise SystemExit(9)\n",
                encoding="utf-8",
            )
    return tmp_path


def none_executed(folder: Path) -> bool:
    return not (folder / "executed").exists()


def test_the_modules_would_be_executed(folder):
    """Python by itself loads them."""
    subprocess.run([sys.executable, "-c", "import json"], cwd=folder, check=False)
    assert not none_executed(folder)


def test_jobs_of_the_screen_load_none(folder):
    job = Call(task="report", given={"sessions": str(folder / "session"), "page": "report.html"}, beside=folder)
    work = BackgroundWork(job, folder)
    assert work.wait() is WorkProgress.DONE, work.failure()
    work.close()
    assert none_executed(folder)


@pytest.mark.parametrize(
    "words", [["check", "session"], ["session", "list", "session"], ["circles", "session"], ["--help"]]
)
def test_commands_that_are_started_in_it_load_none(folder, words):
    done = subprocess.run(python_module("dbbstation", *words), cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert none_executed(folder)


def test_processes_that_share_the_work_load_none(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert dict(each(abs, [-1, -2], 2)) == {0: 1, 1: 2}
    assert none_executed(folder)
    assert "PYTHONSAFEPATH" not in os.environ


def test_programs_that_such_a_process_starts_find_their_own_modules():
    """A user's program may need the modules beside it."""
    found = dict(each(os.getenv, ["PYTHONSAFEPATH", "HOME"], 2))
    assert found == {0: None, 1: os.environ.get("HOME")}
