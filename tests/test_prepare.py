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


@pytest.mark.slow
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
    assert run("dbbstation", "calibrate", SESSION, "--sources", SOURCES) == compiled
    assert run("dbbstation", "predict", "--model", MODEL, "--poses", "poses.csv", "--out", "out.csv") == compiled
    assert run("dbbstation", "diagnose", SESSION) == compiled
