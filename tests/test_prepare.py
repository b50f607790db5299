"""After `python -m dbbstation.prepare` no command compiles anything."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FIXTURES = Path(__file__).parents[1] / "fixtures"
SESSION = FIXTURES / "sessions" / "small"
MODEL = FIXTURES / "models" / "small.yaml"
POSES = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1000,0,0,0\n"
SOURCES = "strut-reference-length,base-joints,backlash,reversal-spike,servo-lag,platform-joints"
COMMANDS = [
    ["calibrate", SESSION, "--sources", SOURCES],
    ["predict", "--model", MODEL, "poses.csv", "--table", "out.csv"],
    ["diagnose", SESSION],
]

SIGNATURES = """
import gc, sys
from numba.core.dispatcher import Dispatcher
from dbbstation.cli import main
from dbbstation.prepare import prepare

def signatures():
    loops = [one for one in gc.get_objects() if isinstance(one, Dispatcher) and one.py_func.__module__.startswith("dbbstation")]
    return {(loop.py_func.__module__, loop.py_func.__name__, *map(str, loop.signatures)) for loop in loops if loop.signatures}

prepare()
print(sorted(signatures()))
for words in COMMANDS:
    try:
        main(words)
    except SystemExit as ended:
        assert ended.code == 0, words
    print(sorted(signatures()))
"""


def test_commands_call_loops_as_preparing_called_them(tmp_path):
    (tmp_path / "poses.csv").write_text(POSES)
    words = [[str(word) for word in command] for command in COMMANDS]
    script = SIGNATURES.replace("COMMANDS", repr(words))
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    prepared, *after = [line for line in done.stdout.splitlines() if line.startswith("[(")]
    assert prepared.count("'dbbstation.") > 5
    assert after == [prepared] * len(COMMANDS)


@pytest.mark.nightly  # compiles all loops anew, into a folder of its own
def test_nothing_is_left_to_compile(tmp_path):
    cache = tmp_path / "cache"

    def run(*arguments):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
        command = [sys.executable, "-m", *map(str, arguments)]
        subprocess.run(command, check=True, cwd=tmp_path, env=environment, capture_output=True, timeout=300)
        return {path.relative_to(cache): path.stat().st_mtime_ns for path in cache.rglob("*.nbc")}

    compiled = run("dbbstation.prepare")
    assert len(compiled) > 5
    (tmp_path / "poses.csv").write_text(POSES)
    for command in COMMANDS:
        assert run("dbbstation", *command) == compiled
