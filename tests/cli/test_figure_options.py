"""`--figure` of diagnose and calibrate: written whole, refused over a file, the numbers untouched."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from dbbstation.cli import DONE, FAILED, USAGE

pytestmark = pytest.mark.usefixtures("answers_kept")


QUICK = ("--sources", "backlash", "--no-held-out")


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
    arguments = ("diagnose", elsewhere, *QUICK, "--json")
    drawn, outcome = drawn_twice(run, tmp_path / "diagnosis.svg", *arguments)
    assert b"residual of each test within its mounting" in drawn
    assert outcome.data == run(*arguments).data


def test_a_calibration_drawn(run, elsewhere, tmp_path):
    arguments = ("calibrate", elsewhere, "--json")
    drawn, outcome = drawn_twice(run, tmp_path / "calibration.svg", *arguments)
    assert b"leverage of each test" in drawn
    assert outcome.data == run(*arguments).data


def test_a_calibration_without_known_places_drawn(run, elsewhere, tmp_path):
    drawn = tmp_path / "conv-a.svg"
    outcome = run("calibrate", elsewhere, "--method", "conv-a", "--figure", drawn)
    assert outcome.code == DONE, outcome.err
    assert "no ball of known place" in drawn.read_text(encoding="utf-8")


BEGINS = {".png": b"\x89PNG\r\n\x1a\n", ".pdf": b"%PDF-1."}
"""PNG: ISO/IEC 15948, 5.2; PDF: ISO 32000-1, 7.5.2."""


@pytest.mark.parametrize(
    ("command", "ending"),
    [
        pytest.param(("calibrate",), ".png", marks=pytest.mark.nightly),
        (("calibrate",), ".pdf"),
        pytest.param(("calibrate",), ".PNG", marks=pytest.mark.nightly),
        (("diagnose", *QUICK), ".png"),
        pytest.param(("diagnose", *QUICK), ".pdf", marks=pytest.mark.nightly),
    ],
)
def test_the_ending_says_the_format(run, elsewhere, tmp_path, command, ending):
    target = tmp_path / f"figure{ending}"
    outcome = run(command[0], elsewhere, *command[1:], "--figure", target)
    assert outcome.code == DONE, outcome.err
    first = target.read_bytes()
    assert first.startswith(BEGINS[ending.lower()])
    assert len(first) > 5000
    assert run(command[0], elsewhere, *command[1:], "--figure", target, "--force").code == DONE
    assert target.read_bytes() == first


@pytest.mark.parametrize(
    "command",
    [
        ("calibrate", "session"),
        ("diagnose", "session"),
        ("compare", "one", "other"),
        ("identify", "recording.csv"),
        ("study", "gravity"),
        ("study", "concealed-gravity"),
    ],
)
@pytest.mark.parametrize("name", ["figure.jpg", "figure.svg.gz", "figure"])
def test_other_endings_are_refused_before_anything_is_read(run, tmp_path, command, name):
    outcome = run(*command, "--figure", tmp_path / name)
    assert (outcome.code, outcome.out) == (USAGE, "")
    assert ".svg, .png, .pdf" in " ".join(outcome.err.split())
    assert not (tmp_path / name).exists()
