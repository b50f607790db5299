"""The example package builds, installs and adds an instrument, a simulator, an error source and an NC dialect."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

PACKAGE = Path(__file__).parents[2] / "docs" / "examples" / "package"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Commands of the program beside the installed package."""
    folder = tmp_path_factory.mktemp("package")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder]
    subprocess.run(command, cwd=PACKAGE, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:  # what pip does with a wheel of Python files
        archive.extractall(folder / "site")

    def command_in(*words):
        script = f"import sys; sys.path.insert(0, {str(folder / 'site')!r}); from dbbstation.cli import main; main(sys.argv[1:])"
        done = subprocess.run(
            [sys.executable, "-c", script, *map(str, words)], cwd=folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    command_in.folder = folder
    return command_in


def test_the_instrument_is_listed_and_emulated_bytes_are_described(run):
    assert "example-gauge" in run("instrument", "list")
    assert "9600 baud" in run("instrument", "list", "example-gauge")


def test_the_source_passes_the_trial_of_its_contract(run):
    assert "scales of all struts are bowed alike" in run("sources", "example-bow")


def test_the_dialect_writes_programs(run):
    run("settings", "--template")
    machine, plan = (
        Path(__file__).parents[2] / name
        for name in ("fixtures/machines/reference.yaml", "protocols/plans/ten-minute-check.yaml")
    )
    run("program", "--plan", plan, "--machine", machine, "--dialect", "example-control", "--out", "nc")
    assert len(list((run.folder / "nc").glob("*.exa"))) == 6


def test_the_simulator_is_known_by_its_name_and_runs_without_further_permission(run):
    t = 0.05 * np.arange(80)
    level = np.cumprod(np.r_[1.0, np.full(79, 1.0 - 0.05 * 0.7)])  # its own Euler steps with another rate
    level += 1e-4 * np.random.default_rng(2).standard_normal(80)
    rows = "".join(f"{a:.2f},{b:.6f}\n" for a, b in zip(t, level, strict=True))
    (run.folder / "r.csv").write_text(f"t_s,level_m\n{rows}", encoding="utf-8")
    said = run("mismatch", "r.csv", "--simulator", "example-decay", "--no-held-out")
    (rate,) = (line for line in said.splitlines() if line.startswith("rate "))
    value, u = (float(number) for number in re.findall(r"(\S+) ± (\S+)", rate)[0])
    assert abs(value - 0.7) < 3.0 * u < 0.001
