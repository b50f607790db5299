"""`--figure` of diagnose and calibrate: written whole, refused over a file, the numbers untouched."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from dbbstation.cli import DONE, FAILED


def drawn_twice(run, target, *arguments):
    outcome = run(*arguments, "--figure", target)
    assert outcome.code == DONE, outcome.err
    assert f"figure written to {target}\n" in outcome.err
    first = target.read_bytes()
    assert ET.fromstring(first).tag.endswith("svg")  # noqa: S314 - our own file
    refused = run(*arguments, "--figure", target)
    assert (refused.code, refused.out) == (FAILED, "")
    assert refused.err == f"{target}: the file exists already; give --force to replace it\n"
    assert run(*arguments, "--figure", target, "--force").code == DONE
    assert target.read_bytes() == first
    return first, outcome


def test_a_diagnosis_drawn(run, elsewhere, tmp_path):
    arguments = ("diagnose", elsewhere, "--sources", "backlash", "--json")
    drawn, outcome = drawn_twice(run, tmp_path / "diagnosis.svg", *arguments)
    assert b"residual of each test within its mounting" in drawn
    assert outcome.data == run(*arguments).data


def test_a_calibration_drawn(run, fifteen, tmp_path):
    arguments = ("calibrate", fifteen, "--json")
    drawn, outcome = drawn_twice(run, tmp_path / "calibration.svg", *arguments)
    assert b"leverage of each test" in drawn
    assert outcome.data == run(*arguments).data


def test_a_calibration_without_known_places_drawn(run, elsewhere, tmp_path):
    drawn = tmp_path / "conv-a.svg"
    outcome = run("calibrate", elsewhere, "--method", "conv-a", "--figure", drawn)
    assert outcome.code == DONE, outcome.err
    assert "no ball of known place" in drawn.read_text(encoding="utf-8")
