"""`dbbstation circles` and what `check` says of runs."""

from __future__ import annotations

import csv
import json
import re
import shutil

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.shipped import shipped_folder
from tests.cli.conftest import call
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("circles") / "session"
    record(folder, seed=4, plan=subset(table_ii_plan(4), ["a", "f"]), mechanisms=[RandomKinematics()], rate_hz=20.0)
    return folder


def test_figures_agree_with_evaluate():
    circles = call("circles", SMALL, "--json").data["runs"]
    evaluated = call("evaluate", SMALL, "--model", MODEL, "--json").data["runs"]
    assert len(circles) == len(evaluated)
    for one, other in zip(circles, evaluated, strict=True):
        assert (one["test"], one["direction"], one["repeat"]) == (other["test"], other["direction"], other["repeat"])
        assert one["g_least_squares_um"] == pytest.approx(other["before"]["circularity_um"], abs=1e-6)
        assert one["mean_radial_error_um"] == pytest.approx(other["before"]["mean_radial_error_um"], abs=1e-6)
        assert one["g_um"] <= one["g_least_squares_um"]


def test_json_has_every_figure_with_its_budget(session):
    data = call("circles", session, "--filter", "50", "--json").data
    assert data["edition"] == "ISO 230-4:2005"
    assert data["filter"] == "Gaussian, 50 UPR"
    assert len(data["runs"]) == 4
    assert len(data["pairs"]) == 2
    for run in data["runs"]:
        assert set(run["uncertainty"]) == {"G", "F", "radius", "X", "Y"}
        for budget in run["uncertainty"].values():
            assert budget["u_um"] == pytest.approx(np.sqrt(sum(u**2 for u in budget["terms_um"].values())))
        assert [h["undulations"] for h in run["harmonics"]] == list(range(2, 11))
    assert set(data["pairs"][0]["uncertainty"]) == {"G(b)", "D", "H"}


def test_a_filter_makes_noise_smaller(session):
    g = [call("circles", session, "--filter", f, "--json").data["runs"][0]["g_um"] for f in ("none", "150", "50", "15")]
    assert g == sorted(g, reverse=True)


def test_the_table_is_what_json_has(session, tmp_path):
    out = tmp_path / "circles.csv"
    data = call("circles", session, "--findings", "--csv", out, "--json").data
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(data["runs"])
    for row, run in zip(rows, data["runs"], strict=True):
        assert float(row["g_um"]) == pytest.approx(run["g_um"], rel=1e-8)
        assert float(row["f_max_um"]) == pytest.approx(run["f_um"]["max"], rel=1e-8)
        assert float(row["u_g_um"]) == pytest.approx(run["uncertainty"]["G"]["u_um"], rel=1e-8)
        assert row["finding_bump"] == "good"
    again = call("circles", session, "--csv", out)
    assert again.code == FAILED
    assert "--force" in again.err
    assert call("circles", session, "--csv", out, "--force").code == DONE


def test_tests_are_chosen_as_elsewhere(session):
    assert {run["test"] for run in call("circles", session, "--test", "f", "--json").data["runs"]} == {"f"}
    assert {run["test"] for run in call("circles", session, "--exclude", "f", "--json").data["runs"]} == {"a"}
    assert call("circles", session, "--test", "z").code == FAILED
    nothing = call("circles", session, "--exclude", "a,f")
    assert nothing.code == FAILED
    assert "no accepted run is left" in nothing.err


def test_two_sessions_are_told_apart(session):
    out = call("circles", SMALL, session).out
    assert "small" in out
    assert out.splitlines()[1].startswith("session")


def test_a_model_without_findings_is_no_use(session):
    assert call("circles", session, "--model", MODEL).code == USAGE


def test_budget_and_findings_are_printed(session):
    out = call("circles", session, "--test", "a", "--budget", "--findings").out
    assert "noise of the readings" in out
    assert "not stated, and not in U: " in out
    assert "nothing is wrong" in out


def test_a_spoilt_run_is_found_by_both_commands(session, tmp_path):
    """A circle that was run 0.6 mm too large: more than any machine of usual tolerances is off."""
    folder = tmp_path / "spoilt"
    shutil.copytree(session, folder)
    run = folder / "runs" / "f-cw-1.csv"
    lines = run.read_text("utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("t_s"))
    column = lines[head].split(",").index("length_mm")
    for k in range(head + 1, len(lines)):
        cells = lines[k].split(",")
        cells[column] = f"{float(cells[column]) + 0.6:.6f}"
        lines[k] = ",".join(cells)
    run.write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = (folder / "session.yaml").read_text("utf-8")
    kept = "\n".join(line.replace(", sha256: " + digest_of(line), "") for line in text.splitlines())
    (folder / "session.yaml").write_text(kept + "\n", encoding="utf-8")
    assert call("session", "seal", folder).code == DONE
    found = call("circles", folder, "--findings", "--json").data["runs"]
    wrong = {
        f["name"]
        for r in found
        if (r["test"], r["direction"]) == ("f", "cw")
        for f in r["findings"]
        if f["verdict"] == "wrong"
    }
    assert "radius" in wrong
    checked = call("check", folder)
    assert checked.code == DONE
    told = re.search(r"f-cw-1.csv: radius: the bar reads \+(\d+)", checked.err)
    assert told
    assert int(told[1]) == pytest.approx(600, abs=60)
    runs = json.loads(call("check", folder, "--json").out)["files"][0]["runs"]
    assert {run["run"] for run in runs} == {"a ccw 1", "a cw 1", "f ccw 1", "f cw 1"}


def digest_of(line):
    return line.partition("sha256: ")[2].strip(" }") if "sha256" in line else "nothing"


def test_a_quick_look_is_printed_as_symptoms():
    """On the machine of the fixtures: both directions together where both are there, u and the words that it is no cause."""
    outcome = call("circles", SMALL, "--quick-look")
    assert outcome.code == DONE
    assert "On a hexapod these are symptoms, no causes" in outcome.out
    looks = call("circles", SMALL, "--quick-look", "--json").data["quick_look"]
    by_test = {(look["test"], look["repeat"]): look for look in looks}
    assert by_test["g", 1]["directions"] == ["ccw", "cw"]
    both, single = by_test["g", 1], by_test["a", 2]
    assert single["directions"] == ["cw"]
    # The second harmonic of both directions, as `circles` has it: A cos 2(θ - θ_0) is -β R/2 sin 2θ + s R/2 cos 2θ.
    runs = call("circles", SMALL, "--test", "g", "--json").data["runs"]
    waves = [
        run["harmonics"][0]["amplitude_um"] * np.exp(2j * np.radians(run["harmonics"][0]["peak_deg"])) for run in runs
    ]
    mean, radius_m = np.mean(waves), 1e-3 * runs[0]["radius_mm"]
    sizes = {one["signature"]: one for one in both["symptoms"] if one["place"] is None}
    square, scale = sizes["squareness"], sizes["scale mismatch"]
    assert square["value"] == pytest.approx(-2 * mean.imag / radius_m, abs=4 * square["u"])
    assert scale["value"] == pytest.approx(2 * mean.real / radius_m, abs=4 * scale["u"])
    assert {one["signature"] for one in single["symptoms"] if one["value"] is None} == {"squareness", "servo mismatch"}
    assert "quick_look" not in call("circles", SMALL, "--json").data
