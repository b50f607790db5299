"""`dbbstation circles` and what `check` says of runs."""

from __future__ import annotations

import csv
import json
import re
import shutil

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.files.places import shipped_folder
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
        read = {figure: budget["as_read_um"] for figure, budget in one["uncertainty"].items()}
        assert read["G(LS)"] == pytest.approx(other["before"]["circularity_um"], abs=1e-6)
        assert one["mean_radial_error_um"] == pytest.approx(other["before"]["mean_radial_error_um"], abs=1e-6)
        assert read["G"] <= read["G(LS)"]
        assert one["g_um"] < read["G"]


def test_json_has_every_figure_with_its_budget(session):
    data = call("circles", session, "--filter", "50", "--json").data
    assert data["edition"] == "ISO 230-4:2005"
    assert data["filter"] == "Gaussian, 50 UPR"
    assert len(data["runs"]) == 4
    assert len(data["pairs"]) == 2
    for run in data["runs"]:
        assert set(run["uncertainty"]) == {
            "G", "G(LS)", "Fmax", "Fmin", "radius", "mean radial error", "X", "Y"
        }  # fmt: skip
        for figure, budget in run["uncertainty"].items():
            if figure in {"Fmax", "Fmin", "radius", "mean radial error"}:
                assert budget["u_um"] is None
                assert "not absolute, because the session does not state: thermal expansion" in budget["why_not"]
            else:
                assert budget["u_um"] == pytest.approx(np.sqrt(sum(u**2 for u in budget["terms_um"].values())))
        assert [h["undulations"] for h in run["harmonics"]] == list(range(2, 11))
    assert set(data["pairs"][0]["uncertainty"]) == {"G(b)", "G(b)(LS)", "D", "H"}


def test_a_filter_makes_noise_smaller(session):
    found = [
        call("circles", session, "--filter", f, "--json").data["runs"][0]["uncertainty"]["G"]
        for f in ("none", "150", "50", "15")
    ]
    read = [one["as_read_um"] for one in found]
    assert read == sorted(read, reverse=True)
    assert found[-1]["u_um"] < 0.7 * found[0]["u_um"]


def test_a_bar_that_nobody_knows_gives_no_absolute_figures(session, tmp_path):
    """D read -18.6 with U 0.0: nobody had stated the bar."""
    folder = tmp_path / "no-bar"
    shutil.copytree(session, folder)
    text = (folder / "session.yaml").read_text("utf-8")
    kept = [line.replace(", sha256: " + digest_of(line), "") for line in text.splitlines()]
    (folder / "session.yaml").write_text("\n".join(x for x in kept if not x.startswith("bar:")) + "\n", "utf-8")
    assert call("session", "seal", folder).code == DONE
    out = call("circles", folder).out
    assert "D: not absolute, because the session does not state: calibrated length of the bar" in out.replace(
        "Fmax, Fmin, radius, mean radial error, ", ""
    )
    pair = call("circles", folder, "--json").data["pairs"][0]
    assert pair["uncertainty"]["D"]["u_um"] is None
    assert pair["uncertainty"]["H"]["u_um"] > 0.0


def test_the_bars_expansion_is_corrected_once(session, tmp_path):
    """A bar of 11.5 µm/(m K) that was calibrated at 20 °C reads 13.8 µm less at 28 °C; U(D) is that of what is known of it."""
    folder = tmp_path / "warm"
    shutil.copytree(session, folder)
    text = (folder / "session.yaml").read_text("utf-8")
    kept = "\n".join(line.replace(", sha256: " + digest_of(line), "") for line in text.splitlines())
    kept = kept.replace("dbb-session/1", "dbb-session/1")
    kept = re.sub(r"(calibrated_length_mm: [0-9.]+)", r"\1, temp_c: 20.0, expansion_um_m_k: 11.5", kept, count=1)
    kept = re.sub(r"(?m)^ambient_temp_c:.*$", "", kept)
    (folder / "session.yaml").write_text(
        kept.replace("plan: plan.yaml", "plan: plan.yaml\nambient_temp_c: 28.0") + "\n", "utf-8"
    )
    assert call("session", "seal", folder).code == DONE
    cold, warm = (call("circles", one, "--json").data for one in (session, folder))
    length = 1e-3 * 150.0 * 11.5 * 8.0
    d = [one["pairs"][0]["d_um"] for one in (cold, warm)]
    assert d[1] - d[0] == pytest.approx(length, abs=0.02)
    budget = warm["pairs"][0]["uncertainty"]["D"]
    # Two temperatures of 0.3 K, and a coefficient known to 5 %.
    expected = 1e-3 * 150.0 * 11.5 * np.hypot(np.sqrt(2.0) * 0.3, 0.05 * 8.0)
    assert budget["terms_um"]["temperature of the bar"] == pytest.approx(expected, rel=1e-3)
    evaluated = call("evaluate", folder, "--model", MODEL, "--json")
    assert evaluated.code == DONE, evaluated.err
    for one, other in zip(warm["runs"], evaluated.data["runs"], strict=True):
        assert one["mean_radial_error_um"] == pytest.approx(other["before"]["mean_radial_error_um"], abs=1e-3)


def test_the_table_is_what_json_has(session, tmp_path):
    out = tmp_path / "circles.csv"
    data = call("circles", session, "--findings", "--table", out, "--json").data
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(data["runs"])
    for row, run in zip(rows, data["runs"], strict=True):
        assert float(row["g_um"]) == pytest.approx(run["g_um"], rel=1e-8)
        assert float(row["f_max_um"]) == pytest.approx(run["f_um"]["max"], rel=1e-8)
        assert float(row["u_g_um"]) == pytest.approx(run["uncertainty"]["G"]["u_um"], rel=1e-8)
        assert row["finding_bump"] == "good"
    again = call("circles", session, "--table", out)
    assert again.code == FAILED
    assert "--force" in again.err
    assert call("circles", session, "--table", out, "--force").code == DONE


def test_tests_are_chosen_as_elsewhere(session):
    assert {run["test"] for run in call("circles", session, "--tests", "f", "--json").data["runs"]} == {"f"}
    assert {run["test"] for run in call("circles", session, "--exclude", "f", "--json").data["runs"]} == {"a"}
    assert call("circles", session, "--tests", "z").code == FAILED
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
    out = call("circles", session, "--tests", "a", "--budget", "--findings").out
    assert "noise of the readings" in out
    assert "not stated, and therefore not in U: " in out
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
    outcome = call("circles", SMALL, "--quick-look")
    assert outcome.code == DONE
    assert "On a hexapod these are symptoms, no causes" in outcome.out
    looks = call("circles", SMALL, "--quick-look", "--json").data["quick_look"]
    by_test = {(look["test"], look["repeat"]): look for look in looks}
    assert by_test["g", 1]["directions"] == ["ccw", "cw"]
    both, single = by_test["g", 1], by_test["a", 2]
    assert single["directions"] == ["cw"]
    # The second harmonic of both directions, as `circles` has it: A cos 2(θ - θ_0) is -β R/2 sin 2θ + s R/2 cos 2θ.
    runs = call("circles", SMALL, "--tests", "g", "--json").data["runs"]
    waves = [
        run["harmonics"][0]["amplitude_um"] * np.exp(2j * np.radians(run["harmonics"][0]["peak_deg"])) for run in runs
    ]
    mean, radius_m = np.mean(waves), 1e-3 * runs[0]["radius_mm"]
    sizes = {one["signature"]: one for one in both["symptoms"] if one["place"] is None}
    square, scale = sizes["squareness"], sizes["scale mismatch"]
    assert square["value"] == pytest.approx(-2 * mean.imag / radius_m, abs=4 * square["u"])
    assert scale["value"] == pytest.approx(2 * mean.real / radius_m, abs=4 * scale["u"])
    mixed = {one["signature"] for one in single["symptoms"] if one["value"] is None and one["below"] is None}
    assert mixed == {"squareness", "servo mismatch"}
    assert "quick_look" not in call("circles", SMALL, "--json").data
