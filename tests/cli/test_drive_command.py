"""`dbbstation identify` as a person or a program calls it."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.files.places import shipped_folder
from tests.diagnosis.drive.plant import Truth, record, to_and_fro

pytestmark = pytest.mark.usefixtures("answers_kept")


@pytest.fixture(scope="module")
def strut(tmp_path_factory):
    """A recording of 12 s of a drive with Coulomb friction, more one way than the other as it goes faster."""
    path = tmp_path_factory.mktemp("drive") / "strut.csv"
    columns = record(Truth(coulomb=20.0, viscous_asymmetry=-40.0), to_and_fro(seconds=12.0))
    lines = [f"{t:.3f},{x:.6f},{f:.4f}" for t, x, f in zip(*columns, strict=True)]
    path.write_text("\n".join(["# strut 3, cold", "t_s,position_mm,force_n", *lines]) + "\n")
    return path


def test_a_person_reads_names_values_and_the_gain(run, strut):
    outcome = run("identify", strut)
    assert outcome.code == DONE
    assert "Mass and viscous friction leave" in outcome.out
    assert "coulomb-friction    identified" in outcome.out
    assert "+ friction-asymmetry" in outcome.out
    assert "friction forwards: viscous_n_s_m 1" in outcome.out
    assert "Nothing is left beyond noise." in outcome.out


def test_a_program_reads_the_same(run, strut, tmp_path):
    out, figure = tmp_path / "compared.csv", tmp_path / "strut.svg"
    outcome = run("identify", strut, "--json", "--table", out, "--figure", figure)
    assert outcome.code == DONE
    data = outcome.data
    assert [step["added"] for step in data["held_back"]["steps"]] == [None, "coulomb-friction", "friction-asymmetry"]
    assert data["parameters"]["mass_kg"]["value"] == pytest.approx(80.0, rel=0.01)
    assert {"t_s", "position_mm", "share", "at_reversal", "direction"} <= set(data["locations"][0])
    table = np.genfromtxt(out, delimiter=",", names=True)
    assert len(table) == data["signals"]["samples_compared"]
    left = table["force_n"] - table["model_force_n"]
    assert np.sqrt(np.mean(left**2)) == pytest.approx(data["residual_rms_n"]["after"], rel=1e-3)
    assert figure.read_bytes().count(b"<svg") == 1
    assert run("identify", strut, "--figure", figure).code == FAILED
    first = figure.read_bytes()
    assert run("identify", strut, "--figure", figure, "--force").code == DONE
    assert figure.read_bytes() == first


def test_currents_and_chosen_causes(run, strut, tmp_path):
    path = tmp_path / "current.csv"
    rows = [line.split(",") for line in strut.read_text().splitlines()[2:]]
    text = "\n".join(f"{t},{x},{float(f) / 400.0:.7f}" for t, x, f in rows)
    path.write_text("t_s,position_mm,motor_current_a\n" + text + "\n")
    refused = run("identify", path)
    assert refused.code == FAILED
    assert "current.csv:1: there is `motor_current_a` and no `force_n`" in refused.err
    outcome = run("identify", path, "--force-per-ampere", "400", "--sources", "coulomb-friction", "--json")
    assert [s["name"] for s in outcome.data["sources"]] == ["coulomb-friction"]
    # The asymmetry that was not asked for pulls at it.
    assert outcome.data["sources"][0]["parameters"]["coulomb_n"]["value"] == pytest.approx(20.0, rel=0.1)
    # What was not looked for is not named, and told to be left.
    assert outcome.data["unexplained"]["variable"] == "speed"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere.csv",), "there is no such file"),
        (("{strut}", "--sources", "coulomb-frictoin"), "did you mean coulomb-friction?"),
        (("{strut}", "--cutoff-hz", "900"), "a cut-off of 900 Hz does not suit"),
        (("{strut}", "--table", "nowhere/x.csv"), "there is no folder"),
    ],
)
def test_what_cannot_be_done_is_said(run, strut, arguments, said):
    outcome = run("identify", *(argument.format(strut=strut) for argument in arguments))
    assert outcome.code == FAILED
    assert said in outcome.err
    assert outcome.out == ""


def test_the_example_of_the_documentation(run):
    """fixtures/drives/strut.csv, made by `python -m tests.diagnosis.drive.make_example`, says in its head what is true."""
    data = run("identify", shipped_folder("fixtures") / "drives" / "strut.csv", "--json").data
    numbers = [
        (data["parameters"]["mass_kg"], 80.0),
        (data["friction"]["forwards"]["viscous_n_s_m"], 160.0),
        (data["friction"]["backwards"]["viscous_n_s_m"], 240.0),
        (data["friction"]["forwards"]["coulomb_n"], 20.0),
    ]
    assert all(abs(number["value"] - true) < 3.0 * number["uncertainty"] for number, true in numbers)
    assert {s["name"] for s in data["sources"] if s["verdict"] == "identified"} == {
        "coulomb-friction",
        "friction-asymmetry",
    }
