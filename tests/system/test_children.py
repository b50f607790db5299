"""Programs that are run: bounded in time, memory and output, and ended with all that they started."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import TYPE_CHECKING

import psutil
import pytest

from dbbstation.system.children import BoundExceededError, ProgramBounds, python_module, run_bounded

if TYPE_CHECKING:
    from pathlib import Path

WIDE = ProgramBounds(time_s=60.0, memory_mb=2000.0, output_mb=50.0)
PATIENCE_S = 20.0


def run(script: str, folder: Path, bounds: ProgramBounds = WIDE):
    return run_bounded([sys.executable, "-c", script], folder, bounds)


def test_a_program_ends_with_its_code_and_what_it_said_last(tmp_path):
    ended = run("import sys; sys.stderr.write('x' * 200_000 + 'no disk'); sys.exit(3)", tmp_path)
    assert ended.code == 3
    assert ended.said.endswith("xno disk")
    assert len(ended.said) < 100_000


GRANDCHILD = """
import subprocess, sys
from pathlib import Path
inner = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
Path("pid").write_text(str(inner.pid))
"""


@pytest.mark.parametrize("then", ["import time; time.sleep(600)", "sys.exit(0)", "raise SystemExit(1)"])
def test_what_a_program_started_ends_with_it(tmp_path, then):
    bounds = ProgramBounds(time_s=1.0, memory_mb=2000.0, output_mb=50.0)
    if "600" in then:
        with pytest.raises(BoundExceededError, match="takes longer than 1 s") as refused:
            run(GRANDCHILD + then, tmp_path, bounds)
        assert refused.value.of_time
    else:
        run(GRANDCHILD + then, tmp_path)
    inner = int((tmp_path / "pid").read_text())
    until_s = time.monotonic() + PATIENCE_S
    while psutil.pid_exists(inner) and psutil.Process(inner).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < until_s, "it goes on"
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("script", "bounds", "what"),
    [
        ("while True: print('x' * 100_000)", {"output_mb": 5.0}, "writes more than 5 MB"),
        ("import sys\nwhile True: sys.stderr.write('x' * 100_000)", {"output_mb": 5.0}, "writes more than 5 MB"),
        ("open('o', 'wb').write(bytes(9_000_000))", {"output_mb": 5.0}, "writes more than 5 MB"),
        (
            "x = bytearray(300_000_000); import time; time.sleep(600)",
            {"memory_mb": 200.0},
            "takes more than 200 MB of memory",
        ),
    ],
)
def test_each_bound_ends_a_program(tmp_path, script, bounds, what):
    begun = psutil.Process().memory_info().rss
    with pytest.raises(BoundExceededError, match=what) as refused:
        run(script, tmp_path, ProgramBounds(**{"time_s": 60.0, "memory_mb": 2000.0, "output_mb": 50.0, **bounds}))
    assert not refused.value.of_time
    assert psutil.Process().memory_info().rss - begun < 50e6


def test_a_program_that_is_not_there_is_an_error_of_the_system(tmp_path):
    with pytest.raises(OSError, match="no-such-program"):
        run_bounded([str(tmp_path / "no-such-program")], tmp_path, WIDE)


def test_modules_in_the_working_folder_are_not_loaded(tmp_path):
    (tmp_path / "json.py").write_text("raise SystemExit('loaded')", encoding="utf-8")
    done = subprocess.run(
        python_module("json.tool", "--help"), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, "loaded" in done.stderr) == (0, False)
