"""Tests in a process without the POSIX names, on files that behave as on Windows: `tests/system/windows/sitecustomize.py`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

RUN = (
    "tests/system/as_on_windows.py",
    "tests/files/recordings/test_lock.py",
    "tests/files/recordings/test_journal.py",
    "tests/files/recordings/test_event_log.py",
    "tests/files/recordings/test_seal.py",
    "tests/files/recordings/test_session_writer.py",
    "tests/files/test_atomic.py",
    "tests/cli/test_session_command.py",
    "tests/station/test_faults.py::test_killed_in_mid_run_it_loses_nothing_and_goes_on",
    "tests/service/test_front.py::test_work_answers_with_its_result",
    "tests/service/test_front.py::test_work_can_be_ended",
    "tests/cli/test_history_command.py::test_a_recording_that_is_damaged_afterwards_is_noticed_at_once",
    "tests/tasks/test_executors.py::test_processes_do_each_piece_once",
    "tests/tasks/test_executors.py::test_a_process_that_is_killed_loses_nothing",
)
"""Locks, journals, logs and seals; a circle recorded, killed and resumed; verdicts; jobs of the screen, a report among them; what a history keeps; work in processes."""

NOT_THERE = (
    "session_that_is_moved_in_mid_run",  # no folder with an open file can be moved
    "part_that_was_removed_while_it_is_recorded",  # no open file can be removed
    "data_is_on_disk_before_the_name",  # no folder can be synced
    "power_cut_that_mixes_blocks",  # of the reader alone
)
"""Cannot happen on Windows, or asks nothing of the system."""

LEAST = 120
"""Tests: fewer mean that the list above no longer finds them."""


def test_circles_are_recorded_judged_and_sealed_as_on_windows(tmp_path):
    environment = {
        **os.environ,
        "DBBSTATION_AS_ON_WINDOWS": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(ROOT / "tests" / "system" / "windows"), str(ROOT)]),
    }
    # The run is one of its own, and no worker of this one.
    for name in ("PYTEST_XDIST_WORKER", "PYTEST_CURRENT_TEST", "PYTEST_ADDOPTS"):
        environment.pop(name, None)
    without = " and ".join(f"not {name}" for name in NOT_THERE)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        f"--basetemp={tmp_path / 't'}",
        "-k",
        without,
    ]
    done = subprocess.run([*command, *RUN], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    said = done.stdout[-20_000:] + done.stderr[-2_000:]
    assert done.returncode == 0, said
    passed = re.search(r"(\d+) passed", done.stdout)
    assert passed is not None, said
    assert int(passed[1]) >= LEAST
