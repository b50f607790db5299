"""A frame that follows the shop, from recordings with a temperature column: fitted, kept, evaluated, refused elsewhere."""

from __future__ import annotations

import pytest

from dbbstation.cli import FAILED
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.thermal import ThermalFrame
from tests.plant.mechanisms.warming import Shop
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

SHOP = Shop(rise_k=1.2, time_constant_s=900.0)
SOURCES = "strut-reference-length,base-joints,thermal-frame"


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shop")
    for name in ("logged", "bare"):
        frame = ThermalFrame(SHOP, logged=name == "logged")
        record(folder / name, seed=19, mechanisms=[RandomKinematics(), frame], rate_hz=5.0)
    return folder


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    folder = tmp_path_factory.mktemp("few")
    for name in ("logged", "bare"):
        frame = ThermalFrame(SHOP, logged=name == "logged")
        plan = subset(table_ii_plan(19), "agl")
        # At two rates, so that no run repeats the other session's noise.
        rate_hz = 5.0 if frame.logged else 6.0
        record(folder / name, seed=19, plan=plan, mechanisms=[RandomKinematics(), frame], rate_hz=rate_hz)
    return folder


def test_calibrate_follows_the_thermometer_and_keeps_its_form(run, sessions, tmp_path):
    model, poses = tmp_path / "model.yaml", tmp_path / "poses.csv"
    called = run("calibrate", sessions / "logged", "--sources", SOURCES, "--out", model, "--json")
    assert called.code == 0
    assert "note: thermal-frame follows the logged temperatures, not a law over time" in called.err
    (frame,) = (s for s in called.data["sources"] if s["name"] == "thermal-frame")
    growth = frame["parameters"]["growth_um_m_k"]
    assert growth["unit"] == "µm/(m K)"
    assert growth["value"] == pytest.approx(11.5, abs=4.0 * growth["uncertainty"])
    again = run("evaluate", sessions / "logged", "--model", model, "--json")
    assert again.code == 0
    assert again.data["residual_rms_um"] == pytest.approx(called.data["residual_rms_um"], rel=1e-6)
    assert (
        "(without thermal-frame: their effect does not follow from the pose alone)"
        in run("evaluate", sessions / "logged", "--model", model).out
    )
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n")
    refused = run("predict", "--model", model, poses, "--table", tmp_path / "actual.csv")
    assert refused.code == FAILED
    assert "thermal-frame needs temperature" in refused.err


def test_where_growth_is_counted_from_does_not_hang_on_what_is_left_out(run, sessions, tmp_path):
    model = tmp_path / "model.yaml"
    fitted = run("calibrate", sessions / "logged", "--sources", SOURCES, "--exclude", "a,b", "--out", model, "--json")
    evaluated = run("evaluate", sessions / "logged", "--model", model, "--exclude", "c", "--json")
    assert evaluated.data["residual_rms_um"] < 1.5 * fitted.data["residual_rms_um"]
    assert evaluated.data["plane_without"] == ["thermal-frame"]


def test_the_law_can_be_asked_for(run, sessions):
    called = run("calibrate", sessions / "logged", "--sources", SOURCES, "--law-over-time", "--json")
    assert called.code == 0
    (frame,) = (s for s in called.data["sources"] if s["name"] == "thermal-frame")
    assert "time_constant_s" in frame["parameters"]


def test_sessions_with_and_without_a_thermometer_go_together(run, few):
    both = (few / "logged", few / "bare")
    together = run("diagnose", *both, "--sources", "thermal-frame", "--no-held-out", "--json")
    assert together.code == 0, together.err
    named = {s["name"]: s for s in together.data["sources"]}
    assert "growth_um_m_k" not in named["thermal-frame"]["parameters"]


def test_the_figure_is_drawn_over_the_thermometer(run, few, tmp_path):
    figure = tmp_path / "diagnosis.svg"
    asked = ("--sources", "thermal-frame,gravity", "--no-held-out", "--figure", figure, "--json")
    found = run("diagnose", few / "logged", *asked)
    assert found.code == 0, found.err
    assert found.data["sources"][0]["name"] == "thermal-frame"
    assert "over temperature" in figure.read_text()


def test_calibrate_takes_the_law_over_time_without_one(run, sessions):
    called = run("calibrate", sessions / "bare", "--sources", SOURCES, "--json")
    assert called.code == 0
    assert "logged temperatures" not in called.err
    (frame,) = (s for s in called.data["sources"] if s["name"] == "thermal-frame")
    assert set(frame["parameters"]) == {"growth_um_m", "time_constant_s", "pause_loss_um_m"}
