"""Spoilt files into commands: no internal fault, bounded memory and time. A part in CI; the whole is `python -m tests.fuzz`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dbbstation.files import checking
from tests.fuzz.__main__ import cases_of, report
from tests.fuzz.seeds import SEEDS
from tests.fuzz.worker import Reached, place, run

CASES, PARTS = 100, 4
"""Cases of a part: 400 in all, within half a minute of one core of CI."""


WORK = """
import sys
from pathlib import Path
from tests.fuzz.worker import main

for part in sys.argv[1:]:
    folder, *numbers = part.split("|")
    if not main(Path(folder), *map(int, numbers)):
        break
"""


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Cases of each part; one process begins the next part where the one before ends, as long as it is small."""
    folders = [tmp_path_factory.mktemp("part") for _ in range(PARTS)]
    while True:
        done = [cases_of(folder) for folder in folders]
        left = []
        for number, (folder, found) in enumerate(zip(folders, done, strict=True)):
            (folder / "worker-0").mkdir(exist_ok=True)
            first = max(found, default=-1) + 1
            if first < CASES:
                left.append(f"{folder / 'worker-0'}|{1 + number}|{first}|1|{CASES}")
        if not left:
            return done
        subprocess.run([sys.executable, "-c", WORK, *left], check=True, cwd=Path(__file__).parents[2])


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_no_spoilt_file_is_a_fault_of_the_program(parts, capsys, part):
    found = parts[part]
    assert len(found) == CASES
    assert sum(told["guided"] for told in found.values()) == CASES // 2
    assert report(found), capsys.readouterr().out


def test_an_internal_fault_is_seen(tmp_path, monkeypatch):
    place({"a.yaml": b"format: dbb-machine/1\n"}, tmp_path / "here")
    assert run("check a.yaml", tmp_path / "here") == (1, "")
    monkeypatch.setattr(checking, "load_yaml", lambda *_: {}["nothing"])
    code, fault = run("check a.yaml", tmp_path / "here")
    assert code is None
    assert fault.startswith("KeyError at")


@pytest.mark.parametrize(("key", "value"), [("fault", "KeyError at x:1: 'a'"), ("peak_mb", 501), ("cpu_s", 20.5)])
def test_a_fault_much_memory_and_long_work_fail(key, value):
    told = {
        "case": 0,
        "kind": "k",
        "line": "check x",
        "fault": "",
        "guided": False,
        "cpu_s": 0.1,
        "peak_mb": 90,
        "code": 1,
    }
    assert report({0: told})
    assert not report({0: told | {key: value}})


def test_files_that_reach_new_lines_are_kept_and_spoilt_further(tmp_path):
    place({"a.yaml": b"format: dbb-machine/1\n"}, tmp_path / "here")
    (tmp_path / "kept").mkdir()
    reached = Reached(tmp_path / "kept")
    for data, new in ((b"format: dbb-machine/1\n", True), (b"format: dbb-machine/1\n", False), (b"[1", True)):
        place({"a.yaml": data}, tmp_path / "here")
        with reached.watching():
            run("check a.yaml", tmp_path / "here")
        assert reached.keep(SEEDS[0], "a.yaml", data) is new


@pytest.mark.nightly
@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: seed.kind)
def test_commands_take_the_sound_files(tmp_path, seed):
    refused = {"NC program with parameters", "session begun"}
    for line in seed.commands:
        place(seed.files, tmp_path / "here")
        code, fault = run(line, tmp_path / "here")
        assert not fault
        assert code == 0 or seed.kind in refused or "a-ccw-1" in line, line
