"""Two processes that judge runs of one session at once: who is told that it is done finds it done.

pytest -m nightly tests/station/test_two_writers.py -s
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import sys
from pathlib import Path

import pytest

from dbbstation.errors import StationError
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.event_log import read_event_log
from dbbstation.files.recordings.lock import PATIENCE_S
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes that are forked")


def judge(folder: Path, name: str, reason: str, begin: int, told: int) -> None:
    os.read(begin, 1)
    try:
        with SessionWriter.open(folder, PATIENCE_S) as writer:
            run = next(run for run in writer.runs if run.label == name)
            writer.judge(run, accepted=False, reason=reason)
    except StationError as problem:
        os.write(told, f"{problem}\n".encode())
    else:
        os.write(told, b"done\n")


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    "times", [pytest.param(10, marks=pytest.mark.slow), pytest.param(500, marks=pytest.mark.nightly)]
)
def test_two_verdicts_at_once_are_both_there(tmp_path: Path, times: int) -> None:
    folder = Path(shutil.copytree(shipped_folder("fixtures") / "sessions" / "logged", tmp_path / "session"))
    context = multiprocessing.get_context("fork")
    names = [run.label for run in read_session(folder).runs[:2]]
    done = refused = 0
    for number in range(times):
        if number % 50 == 0:
            shutil.rmtree(folder)
            shutil.copytree(shipped_folder("fixtures") / "sessions" / "logged", folder)
            events = 25
        begin, go = os.pipe()
        out, told = os.pipe()
        reasons = [f"{name}, {number}" for name in names]
        pair = [
            context.Process(target=judge, args=(folder, name, reason, begin, told))
            for name, reason in zip(names, reasons, strict=True)
        ]
        for one in pair:
            one.start()
        os.write(go, b"..")
        for one in pair:
            one.join()
        for each in (begin, go, told):
            os.close(each)
        said = os.read(out, 65536).decode().splitlines()
        os.close(out)
        count = said.count("done")
        done, refused, events = done + count, refused + len(said) - count, events + count
        runs = {run.label: run.reason for run in read_session(folder).runs}
        assert sum(runs[name] == reason for name, reason in zip(names, reasons, strict=True)) == count, said
        assert len(read_event_log(folder, []).events) == events
    sys.stdout.write(f"\n{times} times two verdicts at once: {done} done, {refused} refused, none lost\n")
    assert done > times
