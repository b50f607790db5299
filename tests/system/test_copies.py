"""Commands as copies of a loaded process: outputs, codes, folder and end are those of a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import psutil
import pytest

from dbbstation.errors import StationError
from dbbstation.files.places import shipped_folder
from dbbstation.system.copies import copies


@pytest.fixture(params=["copied", "anew"])
def start(request, monkeypatch):
    if request.param == "anew":
        monkeypatch.delattr(os, "fork")
    with copies("dbbstation", "json") as begin:
        yield begin


def test_outputs_code_and_folder(start, tmp_path):
    (tmp_path / "machine.yaml").write_text("format: nothing\n")
    with start(["--version"], tmp_path, answers=True) as process:
        assert process.communicate() == ("dbbstation, version 0.1.0\n", "")
        assert process.wait() == 0
    with start(["check", "machine.yaml"], tmp_path, answers=True) as process:
        out, said = process.communicate()
        assert "machine.yaml" in out + said
        assert process.wait() == 1
    with start(["no-such-command"], tmp_path, answers=False) as process:
        assert process.stdout is None
        assert "No such command" in process.stderr.read()
        assert process.wait() == 2


def test_two_at_once_the_later_ends_first(start, tmp_path):
    with (
        start(["instrument", "ports"], tmp_path, answers=True) as first,
        start(["--help"], tmp_path, answers=True) as second,
    ):
        assert second.communicate()[0].startswith("Usage: ")
        assert second.wait() == 0
        first.communicate()
        assert first.wait() in {0, 1}


EMULATED = ["instrument", "emulate", "--instrument", "streaming-encoder", "--seed", "1"]


def test_a_fault_ends_the_command(start, tmp_path, plan_and_machine):
    with suppress(StationError), start([*EMULATED, *plan_and_machine], tmp_path, answers=True) as process:
        assert process.stdout.readline().startswith("port: ")
        raise StationError("no")
    assert process.wait() in {0, 1}  # switched off, or interrupted before it runs


def test_a_killed_command_has_the_signal_as_its_code(start, tmp_path, plan_and_machine):
    with start([*EMULATED, *plan_and_machine], tmp_path, answers=True) as process:
        assert process.stdout.readline().startswith("port: ")
        process.kill()
    assert process.wait() == -signal.SIGKILL


def test_commands_end_with_the_process_that_asked_for_them(tmp_path, plan_and_machine):
    asking = subprocess.Popen(
        [sys.executable, "-c", ASKING, str(tmp_path), *EMULATED, *plan_and_machine], stdout=subprocess.PIPE, text=True
    )
    with asking:
        number = int(asking.stdout.readline())
        asking.kill()
    until_s = time.monotonic() + 60.0
    while psutil.pid_exists(number) and time.monotonic() < until_s:
        time.sleep(0.05)
    assert time.monotonic() < until_s


ASKING = """
import sys
from pathlib import Path
from dbbstation.system.copies import copies
with copies("dbbstation", "json") as start, start(sys.argv[2:], Path(sys.argv[1]), answers=True) as process:
    process.stdout.readline()
    print(process._pid, flush=True)
    process.wait()
"""


@pytest.fixture
def plan_and_machine():
    plan = shipped_folder("protocols") / "plans" / "table2.yaml"
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    return ["--plan", str(plan), "--machine", str(machine)]
