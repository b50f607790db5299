"""`compare` on files: known changes written into recordings, sentences and numbers that agree, and bad input."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED
from tests.cli.conftest import Spoilt
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("answers_kept")
QUICK = ("--no-held-out",)  # which takes most of the time
RUNS = [f"{test}-{direction}-1" for test in "agl" for direction in ("ccw", "cw")]


@pytest.fixture
def three(_three):
    return _three


def lengthen(spoilt):
    """Put 5 µm on every length."""
    for name in RUNS:
        spoilt.column(f"runs/{name}.csv", 1, lambda mm: mm + 0.005)
    return spoilt.folder


@pytest.fixture
def longer(spoilt):
    """The session with 5 µm on every length."""
    return lengthen(spoilt)


@pytest.fixture(scope="module")
def compared(run, _three, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared")
    shutil.copytree(_three, folder / "spoilt")
    longer, drawn = lengthen(Spoilt(folder / "spoilt")), folder / "figure.svg"
    printed = run("compare", _three, longer, "--figure", drawn)
    assert printed.code == DONE
    return longer, drawn, printed.out, run("compare", _three, longer, "--json").data


@pytest.fixture(scope="module")
def with_angles(tmp_path_factory, errors):
    folder = tmp_path_factory.mktemp("recorded") / "angles"
    record(folder, seed=8, plan=subset(table_ii_plan(5), "agl"), mechanisms=[errors], rate_hz=5.0, angles=True)
    return folder


def test_a_constant_that_was_written_into_the_files(run, three, compared):
    longer, _, _, found = compared
    assert found["differ"]
    assert [row["mean_radial_change_um"] for row in found["runs"]] == pytest.approx([5.0] * 6, abs=1e-3)
    best = found["causes"][0]
    assert (best["name"], best["verdict"]) == ("bar-offset", "happened")
    (offset,) = best["parameters"].values()
    assert offset["value"] == pytest.approx(0.005, abs=2 * offset["uncertainty"])
    assert found["organised_text"].startswith("bar-offset, 100 %")
    back = run("compare", longer, three, *QUICK, "--json").data
    (offset,) = back["causes"][0]["parameters"].values()
    assert offset["value"] == pytest.approx(-0.005, abs=2 * offset["uncertainty"])


@pytest.mark.slow
def test_a_centre_that_was_written_into_one_run(run, with_angles, tmp_path):
    """Bar lengths of a circle that lies 20 µm further along +Y, by the cosine law."""
    other = shutil.copytree(with_angles, tmp_path / "other")
    change(other, "g-cw-1", lambda theta, mm: np.sqrt(mm**2 + 2 * mm * 0.02 * np.sin(theta) + 0.02**2))
    found = run("compare", with_angles, other, *QUICK, "--json").data
    worst, *others = found["runs"]
    assert (worst["test"], worst["direction"], worst["differs"]) == ("g", "cw", True)
    assert worst["centre_shift_um"] == pytest.approx([0.0, 20.0], abs=0.01)
    assert abs(worst["peak_theta_deg"] % 180.0 - 90.0) < 3.0
    assert all(row["rms_um"] < 1e-3 for row in others)


def test_what_is_printed_is_what_json_says(compared):
    _, _, printed, found = compared
    assert printed.startswith("The sessions differ: probability 1.000")
    assert found["text"] in printed
    for row in found["runs"]:
        line = next(x for x in printed.splitlines() if x.split()[:2] == [row["test"], row["direction"]])
        assert f"{row['rms_um']:.2f}" in line.split()
        assert ("differs" in line) == row["differs"]
    assert f"in short: {found['organised_text']}" in printed
    assert "diagnose" in printed.splitlines()[-1]


def test_a_recording_and_its_simulated_twin(run, three, tmp_path):
    """What calibrates to noise is no difference: the chain of files, angles and centres adds none."""
    assert run("calibrate", three, "--out", tmp_path / "model.yaml").code == DONE
    twin = [three / "plan.yaml", "--model", tmp_path / "model.yaml", "--out", tmp_path / "twin"]
    assert run("simulate", *twin).code == DONE
    outcome = run("compare", tmp_path / "twin", three)
    assert outcome.code == DONE
    assert outcome.out.startswith("Whether the sessions differ cannot be told: ")
    assert "\nNo difference beyond noise, balls and bars (probability of one " in outcome.out


def test_another_nominal_machine_is_stated_and_compared(run, three, longer, spoilt):
    text = (longer / "machine.yaml").read_text(encoding="utf-8")
    first = re.search(r"base_joints_mm: \[\[(-?[\d.]+)", text)[1]
    spoilt.replace("machine.yaml", first, str(float(first) + 1.0))
    found = run("compare", three, longer, *QUICK, "--json").data
    assert found["differ"]
    assert found["notes"][0].startswith("the nominal machines differ (base joints;")


def test_figure(run, three, compared):
    longer, drawn, _, _ = compared
    first = drawn.read_bytes()
    assert ET.fromstring(first).tag.endswith("svg")  # noqa: S314 - our own file
    assert b"difference, CCW" in first
    again = run("compare", three, longer, "--figure", drawn)
    assert again.code == FAILED
    assert "exists already" in again.err
    assert run("compare", three, longer, "--figure", drawn, "--force").code == DONE
    assert drawn.read_bytes() == first


def test_a_session_and_its_copy(run, three, spoilt):
    outcome = run("compare", three, spoilt.folder)
    assert (outcome.code, outcome.out) == (FAILED, "")
    assert outcome.err == f"{spoilt.folder}: this is the same session as {three}, byte for byte; give two sessions\n"


def test_no_common_test(run, three, elsewhere):
    outcome = run("compare", three, elsewhere)
    assert outcome.code == FAILED
    assert outcome.err.startswith("the sessions have no run in common; compare sessions of one plan: A has accepted")


def test_no_accepted_run(run, three, spoilt):
    path = spoilt.path("session.yaml")
    path.write_text(path.read_text(encoding="utf-8").replace("state: accepted", "state: complete"), encoding="utf-8")
    outcome = run("compare", three, spoilt.folder)
    assert outcome.code == FAILED
    assert outcome.err.startswith(f"{spoilt.folder}: no accepted run is left; ")


def test_removed_centres(run, with_angles, tmp_path):
    removed = shutil.copytree(with_angles, tmp_path / "removed")

    def without_centre(theta, mm):
        waves = np.column_stack([np.cos(theta), np.sin(theta)])
        centre, *_ = np.linalg.lstsq(waves, mm - mm.mean(), rcond=None)
        return mm - waves @ centre

    for name in RUNS:
        change(removed, name, without_centre)
    outcome = run("compare", with_angles, removed)
    assert (outcome.code, outcome.out) == (FAILED, "")
    assert outcome.err.startswith("in session B all circles lie on their commanded centres within noise")


def test_a_run_that_only_one_of_them_has(run, three, longer):
    path = longer / "session.yaml"
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [re.sub("state: accepted", "state: rejected, reason: operator", x) if "a-cw-1" in x else x for x in lines]
    path.write_text("".join(kept), encoding="utf-8")
    found = run("compare", three, longer, *QUICK, "--json").data
    assert (found["only_in_a"], found["only_in_b"], found["runs_compared"]) == (["a cw"], [], 5)


def test_the_command_loads_no_screen(three, elsewhere):
    script = (
        "import sys\nfrom dbbstation.cli import main\ntry:\n"
        f"    main(['compare', {str(three)!r}, {str(elsewhere)!r}])\n"
        "except SystemExit:\n    print('textual' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "False"


def change(folder, name, new_mm):
    """Give a run other lengths, from angles [rad] and lengths [mm], and note its new hash."""
    path = folder / "runs" / f"{name}.csv"
    text = path.read_text(encoding="utf-8")
    before = hashlib.sha256(text.encode()).hexdigest()
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("t_s")) + 1
    columns = lines[start - 1].split(",")
    rows = [line.split(",") for line in lines[start:]]
    at, length = columns.index("theta_deg"), columns.index("length_mm")
    theta = np.radians([float(row[at]) for row in rows])
    for row, mm in zip(rows, new_mm(theta, np.array([float(row[length]) for row in rows])), strict=True):
        row[length] = f"{mm:.9f}"
    path.write_text("\n".join([*lines[:start], *(",".join(row) for row in rows)]) + "\n", encoding="utf-8")
    session = folder / "session.yaml"
    after = hashlib.sha256(path.read_bytes()).hexdigest()
    session.write_text(session.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
