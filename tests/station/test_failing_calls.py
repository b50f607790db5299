"""System calls failing one by one through a run and a verdict: each ends in one sentence or goes on, and nothing is lost.

    pytest -m nightly tests/station/test_failing_calls.py -s

Every call on a file of the session, from opening it to the last fsync: EIO, ENOSPC, EINTR, half of a write, a disk that stays
full, and SIGKILL before and behind it. In CI every eighty-third of them.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dbbstation.files.places import shipped_folder

SOURCE = Path(__file__).with_name("failing_calls.c")

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="calls are taken over as Linux does")


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    built = tmp_path_factory.mktemp("calls") / "failing_calls.so"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", built, SOURCE, "-ldl"], check=True)
    return built


@pytest.mark.parametrize(
    ("every", "begin"), [pytest.param(83, 7, marks=pytest.mark.slow), pytest.param(1, 1, marks=pytest.mark.nightly)]
)
def test_each_ends_in_one_sentence_or_goes_on(library: Path, tmp_path: Path, every: int, begin: int) -> None:
    session = shipped_folder("fixtures") / "sessions" / "logged"
    words = [sys.executable, "-m", "tests.station.failing_calls", session, tmp_path, str(every), str(begin)]
    told = subprocess.run(
        words,
        env={**os.environ, "LD_PRELOAD": str(library)},
        cwd=SOURCE.parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    sys.stdout.write(f"\n{told.stdout}")
    assert told.returncode == 0, told.stderr
    assert "FAULT" not in told.stdout
    assert told.stdout.count(" calls: ") == 7
