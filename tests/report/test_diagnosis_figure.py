"""The figure of a diagnosis: well-formed, the same bytes each time, with every part that has something to show."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest

from dbbstation.diagnosis.findings import Unexplained
from dbbstation.report.diagnosis_figure import diagnosis_figure
from tests.diagnosis.joint_fits import joint_fit

SVG = "{http://www.w3.org/2000/svg}"


def texts(drawn):
    return ["".join(t.itertext()).strip() for t in ET.fromstring(drawn).iter(f"{SVG}text")]  # noqa: S314 - our own


@pytest.fixture(scope="module")
def found(reference):
    return joint_fit(reference, ("backlash", "bar-drift"))


@pytest.fixture(scope="module")
def drawn(found):
    return diagnosis_figure(found)


def test_all_parts_of_what_was_found(drawn):
    said = texts(drawn)
    assert said.count("Found: backlash (identified), bar-drift (identified)") == 1
    for model in ("kinematic model", "with causes found"):
        for direction in ("CCW", "CW"):
            assert f"{model}, {direction}" in said
    assert "measured less model, µm" in said
    assert "backlash: strut-length error over strut length" in said
    assert "bar-drift: error of the reading over time" in said
    assert {"lengthening", "shortening", "joint model", "strut 6", "time, s"} <= set(said)
    assert len([text for text in said if text.startswith("test ") and "µm rms" in text]) == 4
    assert {"residual of each test within its mounting", "circularity left of each test", "noise"} <= set(said)
    assert b"NaN" not in drawn
    assert b"nan" not in drawn


def test_same_diagnosis_same_bytes(found, drawn):
    assert diagnosis_figure(found) == drawn


def test_an_error_without_a_name(reference):
    rest = Unexplained(
        1.0, 3, "strut-length wave", 30.0, "An error without a known name, organised by a wave, strut 3."
    )
    said = texts(diagnosis_figure(joint_fit(reference, ("backlash",), unexplained=rest)))
    assert rest.text in said
    assert "without a name: strut-length error over strut length" in said
    assert not any("causes found" in text for text in said)


def test_nothing_to_find(reference):
    said = texts(diagnosis_figure(joint_fit(reference, ())))
    assert "The recordings agree with the kinematic model" in said
    assert not any("error over" in text for text in said)
