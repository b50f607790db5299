"""The demonstration does the whole job, over a real line, and the machine is better afterwards."""

from __future__ import annotations

import json
import re
import runpy
import shutil
import subprocess
import sys
from contextlib import chdir
from dataclasses import asdict
from pathlib import Path

import pytest

import dbbstation as dbb
from dbbstation.demo import whole_job
from dbbstation.demo.whole_job import QUICK, run_demo
from dbbstation.facts.serialise import as_objects, read_plain
from dbbstation.files.recordings.session import read_session
from dbbstation.results.demo import DemoCircle, DemoResult
from tests.cli.conftest import call
from tests.released import installed, quick_demo, wheel

__all__ = ["installed", "quick_demo", "wheel"]

SCRIPT = Path(__file__).parents[1] / "docs" / "examples" / "whole_job.py"
EIGHT = "abdfhjkn"
"""Of the fifteen: all three heights, tilted and level; half of the work."""


STEPS = ["measure", "calibrate", "diagnose", "program", "measure", "evaluate", "evaluate", "report"]


@pytest.mark.nightly  # the three tests of `demo --quick` are in CI
def test_the_whole_job(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "dbbstation", "demo", "--out", "job", "--json"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    _does_the_whole_job(tmp_path / "job", json.loads(done.stdout), 15)


@pytest.mark.slow
def test_the_whole_job_on_three_of_its_circles(tmp_path, quick_demo):
    told = [line.removeprefix("$ ") for line in quick_demo.err.splitlines() if line.startswith("$ ")]
    steps = [line.removeprefix("dbbstation ").split()[0] for line in told]
    assert steps == STEPS
    job = shutil.copytree(quick_demo.job, tmp_path / "job")  # a script writes into it
    _does_the_whole_job(job, json.loads(quick_demo.out), len(QUICK))


@pytest.mark.nightly
def test_the_whole_job_on_eight_of_its_circles(tmp_path, monkeypatch):
    told = []

    def answer(job, arguments):
        job.tell(" ".join(["dbbstation", *arguments]))
        with chdir(job.folder):
            outcome = call(*arguments, "--json")
        assert outcome.code == 0, outcome.err
        return outcome.out

    monkeypatch.setattr(whole_job.DemoJob, "answer", answer)
    result = run_demo(tmp_path / "job", 3, told.append, lambda *_: None, EIGHT)
    steps = [line.removeprefix("dbbstation ").split()[0] for line in told]
    assert steps == STEPS
    printed = {name: json.loads(answer) for name, answer in result.printed.items()}
    _does_the_whole_job(tmp_path / "job", {"runs": [asdict(run) for run in result.runs], **printed}, len(EIGHT))


@pytest.mark.slow
def test_a_table_of_the_circles_is_printed(tmp_path, monkeypatch, quick_demo):
    told = json.loads(quick_demo.out)
    calibration, diagnosis, report = map(
        as_objects,
        (call("calibrate", quick_demo.job / "measured", "--json").data, told["diagnosis"], told["report"]),
    )
    runs = tuple(read_plain(DemoCircle, run) for run in told["runs"])
    result = DemoResult(quick_demo.job, runs, calibration, diagnosis, report, {})
    monkeypatch.setattr(whole_job, "run_demo", lambda *_: result)
    done = call("demo", "--quick", "--out", tmp_path / "demo")
    assert done.code == 0, done.err
    assert re.search(r"(?m)^mean +\d", done.out)


def _does_the_whole_job(job, result, tests):
    named = {source["name"] for source in result["diagnosis"]["sources"] if source["verdict"] == "identified"}
    assert named == {"gravity"}
    before = [run["before"] for run in result["runs"]]
    after = [run["after"] for run in result["runs"]]
    assert len(before) == tests
    assert sum(run["centre_deviation_um"] for run in before) / tests > 50
    # What remains is where the balls came to stand, 0.6 to 1.9 µm per axis, and the noise of the bar.
    assert max(run["centre_deviation_um"] for run in after) < 10
    assert max(run["circularity_um"] for run in after) < 4
    for session in ("measured", "verified"):  # the balls are in the right bores, and no run is held for another circle
        runs = read_session(job / session).runs
        assert [run.reason for run in runs] == [""] * (2 * tests)
    report = result["report"]
    assert report["verdict"]["kind"] == "within"
    assert [one["cause"] for one in report["causes"]] == ["geometry", "gravity"]
    assert report["causes"][0]["g_um"] > report["causes"][1]["g_um"] > 5.0
    for name in ("measured", "verified", "programs", "kinematic.yaml", "joint.yaml", "report.html"):
        assert (job / name).exists()
    _from_python(job, result)


def _from_python(folder, result):
    """A script of twenty lines that knows the public names only comes to the numbers of the commands, to the last bit but rounding."""
    with chdir(folder):
        found = runpy.run_path(str(SCRIPT))
    assert len([line for line in SCRIPT.read_text().splitlines() if line]) <= 21  # with the line that says what it is
    kinematic = dbb.read_model(folder / "kinematic.yaml")
    assert found["kinematic"].covariance.matrix == pytest.approx(kinematic.covariance, rel=1e-6, abs=1e-15)
    assert found["kinematic"].residual_rms_um == pytest.approx(kinematic.report["residual_rms_um"], rel=1e-9)
    assert same(found["joint"].to_dict(), {k: v for k, v in result["diagnosis"].items() if k != "provenance"})
    measured = {
        (run.test, when): run.measured.centre_deviation_um
        for when in ("before", "after")
        for run in found[when].runs
        if run.direction == "ccw"
    }
    for run in result["runs"]:
        for when in ("before", "after"):
            assert measured[run["test"], when] == pytest.approx(run[when]["centre_deviation_um"], rel=1e-9)
    by_command = dbb.read_model(folder / "joint.yaml")
    by_script = dbb.read_model(folder / "from-python.yaml")
    assert by_script.covariance_rows == by_command.covariance_rows
    assert by_script.covariance == pytest.approx(by_command.covariance, rel=1e-6, abs=1e-15)


def same(one, other):
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return other == pytest.approx(one, rel=1e-6, abs=1e-9)
    return one == other


def test_a_folder_that_exists_is_left_alone(tmp_path):
    (tmp_path / "job").mkdir()
    done = subprocess.run(
        [sys.executable, "-m", "dbbstation", "demo", "--out", "job"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "exists already" in done.stderr
