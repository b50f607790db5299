"""SIGKILL at any moment: every sample that was acknowledged is there, with the value that it had, and the session goes on.

`pytest -m nightly tests/station/test_kills.py -s` kills a hundred times and prints at which moments.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import sys
import time
from collections import Counter
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import parse_session, read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from tests.station.kills import SAMPLES, length_mm, missing, record

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes that are forked and killed")

LONGEST_S = 0.25
"""Some runs of seven hundred samples are sealed within it."""


def killed(folder: Path, after_s: float) -> list[str]:
    out, told = os.pipe()
    child = multiprocessing.get_context("fork").Process(target=record, args=(folder, told))
    child.start()
    os.close(told)
    said = b""
    while b"\n" not in said:
        said += os.read(out, 65536)
    os.set_blocking(out, False)
    end_s = time.monotonic() + after_s
    # The pipe is emptied meanwhile: a process that waits for its reader is killed at no random moment.
    while time.monotonic() < end_s:
        try:
            said += os.read(out, 65536)
        except BlockingIOError:
            time.sleep(0.0005)
    os.kill(child.pid, signal.SIGKILL)
    child.join()
    assert child.exitcode == -signal.SIGKILL
    os.set_blocking(out, True)
    while more := os.read(out, 65536):
        said += more
    os.close(out)
    return said.decode().splitlines()


def check_session(folder: Path, said: list[str]) -> str:
    """Hold the session against everything that was ever acknowledged; return at which moment it was left."""
    faults = []
    session = parse_session(folder, faults)
    assert session is not None
    assert faults == []
    runs = {f"{run.test}-{run.direction}-{run.repeat}": run for run in session.runs}
    samples = Counter(line.split()[1] for line in said if line.startswith("sample "))
    for name, count in samples.items():
        run = runs[name]
        recording = read_run(run.path).recording
        assert len(recording) >= count
        assert recording.length_mm.tolist() == [length_mm(name, k) for k in range(len(recording))]
    assert missing(session, said) == []
    assert all(runs[line.split()[1]].counts.received == SAMPLES for line in said if line.startswith("sealed "))
    last = said[-1].split()
    if last[0] == "sample":
        return "while sealing" if int(last[2]) == SAMPLES - 1 else "between samples"
    behind = {"opened": "starting the first run", "sealed": "noting the verdict", "accepted": "noting something"}
    return behind.get(last[0], "noting a verdict or starting a run")


@pytest.mark.parametrize(
    "kills", [pytest.param(10, marks=pytest.mark.slow), pytest.param(100, marks=pytest.mark.nightly)]
)
def test_nothing_acknowledged_is_lost_wherever_it_is_killed(tmp_path: Path, kills: int) -> None:
    folder = tmp_path / "session"
    rng = random.Random(kills)  # noqa: S311 - moments, no secrets
    said: list[str] = []
    moments: Counter[str] = Counter()
    for number in range(kills):
        if number % 20 == 0:
            # The session file is read with every step: a new one, so that the last kills do not take minutes.
            folder, said = tmp_path / f"session-{number}", []
        said += killed(folder, rng.uniform(0.0, LONGEST_S))
        moments[check_session(folder, said)] += 1
        with SessionWriter.open(folder) as writer:
            assert not [run for run in writer.runs if run.state is RunState.RECORDING and run.path.suffix == ".csv"]
        assert read_session(folder).seal.runs == sum(
            run.state is not RunState.RECORDING for run in read_session(folder).runs
        )
    acknowledged = sum(line.startswith("sample ") for line in said)
    table = ", ".join(f"{count} {moment}" for moment, count in sorted(moments.items()))
    sys.stdout.write(f"\n{kills} kills ({table}): {acknowledged} samples acknowledged in the last session, none lost\n")
