"""A real ball-screw drive, recorded elsewhere: the EMPS benchmark of Janot, Gautier and Brunot (2019).

Expected are the values that its authors publish: 95.1 kg, Coulomb friction 20.4 N, viscous friction 203 N·s/m.
"""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from dbbstation.cli.identify import identify as drive

pytestmark = pytest.mark.usefixtures("few_parts")


@pytest.fixture(scope="module")
def summary(recordings, tmp_path_factory):
    path = recordings / "real" / "emps" / "emps.csv"
    path = path if path.exists() else recordings / "emps" / "emps.csv"
    if not path.exists():
        pytest.skip("the EMPS recording is not in DBBSTATION_RECORDINGS")
    figure = tmp_path_factory.mktemp("emps") / "emps.svg"
    outcome = CliRunner().invoke(drive, [str(path), "--json", "--figure", str(figure)])
    assert outcome.exit_code == 0, outcome.output
    assert b"<svg" in figure.read_bytes()
    return json.loads(outcome.stdout)


def test_mass_and_viscous_friction_are_not_enough(summary):
    assert summary["mismatch"]
    assert summary["probability"] < 1e-6
    before = summary["held_back"]["steps"][0]
    assert before["added"] is None
    assert 0.15 < before["relative_force_error"] < 0.20


def test_coulomb_friction_is_named_first_and_its_asymmetry_next(summary):
    steps = summary["held_back"]["steps"]
    assert [step["added"] for step in steps[1:3]] == ["coulomb-friction", "friction-asymmetry"]
    found = {s["name"]: s for s in summary["sources"]}
    assert found["coulomb-friction"]["verdict"] == found["friction-asymmetry"]["verdict"] == "identified"
    assert steps[1]["relative_force_error"] < 0.5 * steps[0]["relative_force_error"]
    assert steps[2]["relative_force_error"] < 0.05
    assert summary["held_back"]["relative_force_error"]["after"] < 0.05


def test_the_values_are_those_that_are_published(summary):
    mass = summary["parameters"]["mass_kg"]
    assert abs(mass["value"] - 95.1) < 2.0 * mass["uncertainty"]
    coulomb = next(s for s in summary["sources"] if s["name"] == "coulomb-friction")["parameters"]["coulomb_n"]
    assert coulomb["value"] == pytest.approx(20.4, rel=0.1)
    assert summary["parameters"]["viscous_n_s_m"]["value"] == pytest.approx(203.0, rel=0.05)


def test_friction_and_load_are_told_apart_by_the_speed(summary):
    """The asymmetry grows with the speed: a constant load of -3.2 N, the published offset, is not what it is."""
    found = {s["name"]: s for s in summary["sources"]}
    assert found["constant-load"]["verdict"] in {"ruled-out", "not-testable"}
    viscous = found["friction-asymmetry"]["parameters"]["viscous_asymmetry_n_s_m"]
    assert viscous["value"] < -5.0 * viscous["uncertainty"]


def test_what_is_left_is_told_and_not_named(summary):
    assert summary["unexplained"]["significant"]
    assert summary["unexplained"]["rms_n"] < 1.5
