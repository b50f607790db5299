"""`dbbstation calibrate` as a metrologist uses it: methods, prescribed parameters, what is said of the fit."""

from __future__ import annotations

import math

import pytest
import yaml

from dbbstation.cli import FAILED
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

pytestmark = pytest.mark.usefixtures("answers_kept")


@pytest.fixture(scope="module")
def jig_session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("methods") / "jig"
    record(folder, seed=5, mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)], rate_hz=10.0)
    return folder


def test_the_jig_method_tells_everything_a_metrologist_asks(run, jig_session):
    told = run("calibrate", jig_session, "--json").data
    assert told["method"] == "jig"
    assert (told["parameters_identified"], told["outliers"], told["parameters_prescribed"]) == (23, [], [])
    seen = told["observability"]
    assert len(seen["singular_values_mm"]) == 23
    assert seen["indices"]["o2"] == pytest.approx(1.0 / seen["condition"])
    assert set(seen["leverage"]) == set("abcdefghijklmno")
    assert [check["fits"] for check in told["scatter"]] == [True, True]
    assert "raised bar" in told["gaps"][0]


def test_text_and_json_say_the_same(run, jig_session):
    text, data = run("calibrate", jig_session).out, run("calibrate", jig_session, "--json").data
    assert f"least visible, to {data['observability']['weak_directions'][0]['uncertainty']:.1f} µm" in text
    for check in data["scatter"]:
        assert f"scatter by {check['found_um']:.2f}" in text
    _values_have_the_decimals_of_their_u(text, data)


def _values_have_the_decimals_of_their_u(text, data):
    """Two digits of U count [GUM 7.2.6], and no value is printed finer or coarser; not above ten, where its digits are whole ones."""
    (lengths,) = [source for source in data["sources"] if source["name"] == "strut-reference-length"]
    rows = [line.split() for line in text.splitlines() if line.startswith("strut-reference-length")]
    assert len(rows) == 6
    for _, _, strut, *shown, unit in rows:
        number = lengths["parameters"][f"strut_{strut}_mm"]
        expanded = 2e3 * number["uncertainty"]
        decimals = max(1 - math.floor(math.log10(expanded)), 0)
        assert shown == [f"{one:.{decimals}f}" for one in (1e3 * number["value"], expanded / 2.0, expanded)]
        assert unit == "µm"


def test_conv_a_on_a_jig_session_prescribes_six_and_says_which(run, jig_session):
    told = run("calibrate", jig_session, "--method", "conv-a", "--json").data
    assert told["parameters_identified"] == 18
    assert len(told["directions_lost"]) == len(told["parameters_prescribed"]) == 6
    text = run("calibrate", jig_session, "--method", "conv-a").out
    assert f"held at nominal instead: {', '.join(told['parameters_prescribed'])}" in text


def test_prescribed_parameters_may_be_chosen(run, jig_session):
    names = [f"base-joints.joint_{place}_mm" for place in ("1_x", "1_y", "1_z", "3_y", "3_z", "5_z")]
    told = run("calibrate", jig_session, "--method", "conv-a", "--prescribe", ",".join(names), "--json").data
    assert sorted(told["parameters_prescribed"]) == sorted(names)
    (joints,) = [source for source in told["sources"] if source["name"] == "base-joints"]
    for name in names:
        number = joints["parameters"][name.removeprefix("base-joints.")]
        assert number["value"] == pytest.approx(0.0, abs=1e-12)
        assert number["uncertainty"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--method", "conv-b"), "no set-up errors were measured in test a"),
        (("--prescribe", "base-joints.joint_1_z_mm,base-joints.joint_2_z_mm"), "2 parameters are prescribed"),
        (("--prescribe", "joint_1_z_mm"), "cannot be prescribed: these parameters are not fitted"),
    ],
)
def test_what_cannot_be_done_is_said(run, jig_session, arguments, said):
    outcome = run("calibrate", jig_session, *arguments)
    assert outcome.code == FAILED
    assert said in outcome.err


def test_an_outlier_is_told_and_its_model_kept_clean(run, tmp_path):
    """One row of the CMM sheet is 40 µm off in X: the circles are as they were, the plan says otherwise."""
    folder = tmp_path / "spoilt"
    record(folder, seed=5, mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)], rate_hz=10.0)
    session, plan = (folder / "session.yaml").read_text(), (folder / "plan.yaml").read_text()
    before = run("calibrate", folder, "--json").data
    spoilt, centres = _one_row_off(plan)
    (folder / "plan.yaml").write_text(spoilt)
    (folder / "session.yaml").write_text(_with_centres(session, centres))
    outcome = run("calibrate", folder, "--json")
    (outlier,) = outcome.data["outliers"]
    assert outlier["test"] == "h"
    assert outlier["shift_um"][0] == pytest.approx(-40.0, abs=8.0)
    assert "outlier, kept out of the fit: the ball of test h" in outcome.err
    for a, b in zip(before["sources"], outcome.data["sources"], strict=True):
        known = {name: number for name, number in a["parameters"].items() if number["uncertainty"] is not None}
        assert known
        for name, number in known.items():
            assert abs(b["parameters"][name]["value"] - number["value"]) < 3.0 * number["uncertainty"]


def _one_row_off(plan):
    """The plan with the ball of test h moved by 40 µm, and where the programs had that circle's centre."""
    data = yaml.safe_load(plan)
    name = next(test["ball"] for test in data["tests"] if test["name"] == "h")
    origin = data["jig"]["origin_in_machine_mm"]
    centre = data["balls"][name]["centre_mm"]
    was = [o + c for o, c in zip(origin, centre, strict=True)]
    data["balls"][name]["centre_mm"] = [centre[0] + 0.04, *centre[1:]]
    return yaml.safe_dump(data), {"h": was}


def _with_centres(session, centres):
    data = yaml.safe_load(session)
    for entry in data["runs"]:
        if entry["test"] in centres:
            entry["centre_mm"] = centres[entry["test"]]
    return yaml.safe_dump(data)
