"""The bar that was noted must be able to run the circles of the plan."""

from __future__ import annotations

import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.files.places import shipped_folder

PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
STATED = "calibrated_length_mm: 150.0"


@pytest.mark.parametrize("command", [("check",), ("calibrate",), ("diagnose",)])
def test_a_session_with_another_bar_than_its_circles_is_refused(run, spoilt, command):
    """A bar of 100 mm beside circles of 150 mm."""
    path = spoilt.replace("session.yaml", STATED, "calibrated_length_mm: 100.0")
    outcome = run(*command, spoilt.folder)
    assert outcome.code == FAILED
    told = outcome.out + outcome.err
    assert f"{path}:{spoilt.line_of('session.yaml', 'calibrated_length_mm')}" in told
    assert "bar of 100 mm" in told
    assert "radius_mm 150" in told
    assert "held against the plan only" in told


@pytest.mark.parametrize("length_mm", [144.0, 156.0])
def test_one_bar_serves_150_and_144_mm(run, spoilt, length_mm):
    spoilt.replace("session.yaml", STATED, f"calibrated_length_mm: {length_mm}")
    assert run("check", spoilt.folder).code == DONE


def test_a_stated_stroke_holds(run, spoilt):
    spoilt.replace("session.yaml", "dbb-session/1", "dbb-session/1")
    spoilt.replace("session.yaml", STATED, "stroke_mm: 1.0, calibrated_length_mm: 148.5")
    outcome = run("check", spoilt.folder)
    assert outcome.code == FAILED
    assert "stroke of 1 mm" in outcome.out + outcome.err


def measure(run, tmp_path, instrument, length_mm):
    told = ("--bar-length-mm", length_mm, "--bar-uncertainty-um", "0.5", "--bar-waiver", "no calibrator here")
    where = ("--port", tmp_path / "no-port", "--out", tmp_path / "session")
    return run("measure", "--plan", PLAN, "--machine", MACHINE, "--instrument", instrument, *where, *told)


def test_measure_refuses_the_bar_before_it_opens_the_instrument(run, tmp_path):
    outcome = measure(run, tmp_path, "heidenhain-nd281b", "100")
    assert outcome.code == FAILED
    assert "bar of 100 mm" in outcome.err
    assert "no-port" not in outcome.err


def test_the_stroke_comes_from_the_instrument_file(run, tmp_path):
    shipped = shipped_folder("protocols") / "instruments" / "heidenhain-nd281b.yaml"
    own = tmp_path / "short-gauge.yaml"
    text = shipped.read_text().replace("name: heidenhain-nd281b", "name: short-gauge")
    own.write_text(text.replace("\nlength:\n", "\nlength:\n  stroke_mm: 1.0\n"))
    outcome = measure(run, tmp_path, own, "152")
    assert outcome.code == FAILED
    assert "stroke of 1 mm" in outcome.err
    # Within the usual stroke the same length goes as far as the port that is not there.
    assert "no-port" in measure(run, tmp_path, shipped, "152").err


def test_help_says_what_the_length_is_for(run):
    assert "never added to readings" in " ".join(run("measure", "--help").out.split())
