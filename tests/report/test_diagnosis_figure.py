"""The figure of a diagnosis: well-formed, the same bytes each time, with every part that has something to show."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from dbbstation.diagnosis.findings import Curve, CurvePoint, Unexplained
from dbbstation.diagnosis.shapes import READING, Follows
from dbbstation.diagnosis.source_curves import gains_by_test, source_curves
from dbbstation.inference.levels import Followed, FollowsAnswer
from dbbstation.report.diagnosis_figure import diagnosis_figure, draw_unexplained
from dbbstation.results.frame import OnePanel
from tests.diagnosis import joint_fits
from tests.plant.plan import EIGHT

joint_fit = partial(joint_fits.joint_fit, tests=EIGHT)

SVG = "{http://www.w3.org/2000/svg}"


def texts(drawn):
    return ["".join(t.itertext()).strip() for t in ET.fromstring(drawn).iter(f"{SVG}text")]  # noqa: S314 - our own


def drawing(found, *wanted):
    return diagnosis_figure(found, gains_by_test(found), source_curves(found), *wanted)


@pytest.fixture(scope="module")
def found(reference):
    return joint_fit(reference, ("backlash", "bar-drift"))


@pytest.fixture(scope="module")
def drawn(found):
    return drawing(found)


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


def test_what_it_follows_where_and_what_tests_left_out_gain(found):
    """Two classes, of which one was tested: two bars of the lengths that are given, and its name and strut."""
    tested = Followed(
        (("strut-speed-sign",),), (), FollowsAnswer.FOLLOWS, 1.0, {}, 3.0, ("backlash",), 4.0, 1.5, where="strut 3"
    )
    happened = Followed((("time",),), (), FollowsAnswer.HAPPENED, 1.0, {}, 1.0, ("bar-drift",))
    one = replace(found, levels=replace(found.levels, follows=(tested, happened)))
    said = texts(drawing(one))
    assert {"what the difference follows, and where", "strut-speed-sign, strut 3"} <= set(said)
    axes = Figure().subplots()
    drawing(one, OnePanel(axes, "levels"))
    assert [bar.get_width() for bar in axes.patches] == [4.0, 1.5]


def test_same_diagnosis_same_bytes(found, drawn):
    assert drawing(found) == drawn


def test_an_error_without_a_name(reference):
    rest = Unexplained(
        1.0, 3, Follows("strut-length", "wave"), 30.0, "An error without a known name, organised by a wave, strut 3."
    )
    said = texts(drawing(joint_fit(reference, ("backlash",), unexplained=rest)))
    assert rest.text in said
    assert "without a name: strut-length error over strut length" in said
    assert not any("causes found" in text for text in said)


def curve(follows, unit, at, value, sigma, strut=3, period=None, convention=""):
    points = tuple(CurvePoint(*map(float, point)) for point in zip(at, value, sigma, strict=True))
    return Curve(follows, unit, strut, "", period, (), convention, 2.0, 1.0, points)


def panel(drawn):
    part = Figure().subfigures()
    draw_unexplained(part, drawn)
    (axes,) = part.axes
    return part, axes


def test_its_curve_has_a_panel_of_its_own(reference):
    wave = curve(
        Follows("strut-length", "wave"), "mm", [600.0, 610.0, 620.0], [1.0, 0.0, -1.0], [0.1, 0.1, 0.1], 3, 40.0
    )
    rest = Unexplained(1.0, 3, Follows("strut-length", "wave"), 30.0, "organised by a wave", wave)
    said = texts(drawing(joint_fit(reference, ("backlash",), unexplained=rest)))
    assert said.count("without a name: a wave of 40.00 mm: error of strut 3, cause unknown") == 1
    assert "µm, ±2u" in said


def test_the_band_is_two_standard_uncertainties():
    part, axes = panel(
        curve(Follows("strut-force"), "N", [0.0, 5.0, 9.0], [1.0, -2.0, 4.0], [0.5, 0.1, 1.0], None, None, "less")
    )
    (band,) = (each for each in axes.collections if isinstance(each, PolyCollection))
    corners = {(round(float(x), 6), round(float(y), 6)) for x, y in band.get_paths()[0].vertices}
    assert corners == {(0.0, 0.0), (0.0, 2.0), (5.0, -2.2), (5.0, -1.8), (9.0, 2.0), (9.0, 6.0)}
    assert axes.lines[0].get_xydata().tolist() == [[0.0, 1.0], [5.0, -2.0], [9.0, 4.0]]
    assert (axes.get_xlabel(), axes.get_title(loc="right")) == ("strut force, N", "less")
    assert part.get_suptitle() == "without a name: error of every strut, cause unknown"


def test_a_wave_is_drawn_as_one_with_its_uncertainty_between_the_points():
    """Amplitudes 3 and -2 with variances 0.04 and 0.09 and covariance 0.03, in closed form."""

    def value(x):
        return 3.0 * np.cos(2 * np.pi * x / 40.0) - 2.0 * np.sin(2 * np.pi * x / 40.0)

    def sigma(x):
        c, s = np.cos(2 * np.pi * x / 40.0), np.sin(2 * np.pi * x / 40.0)
        return np.sqrt(0.04 * c * c + 0.09 * s * s + 2 * 0.03 * c * s)

    at = np.arange(500.0, 601.0, 5.0)
    _, axes = panel(curve(Follows("strut-length", "wave"), "mm", at, value(at), sigma(at), 3, 40.0))
    x, y = axes.lines[0].get_xydata().T
    assert len(x) > 2 * len(at)
    np.testing.assert_allclose(y, value(x), atol=1e-9)
    (band,) = (each for each in axes.collections if isinstance(each, PolyCollection))
    corners = band.get_paths()[0].vertices
    away = np.abs(corners[:, 1] - value(corners[:, 0]))
    np.testing.assert_allclose(away, 2.0 * sigma(corners[:, 0]), atol=1e-9)
    assert axes.get_xlabel() == "strut length, mm"


def test_signs_of_travel_are_two_points():
    part, axes = panel(curve(Follows("strut-speed-sign"), "sign", [-1.0, 1.0], [-2.0, 2.0], [0.3, 0.3]))
    assert [label.get_text() for label in axes.get_xticklabels()] == ["shortening", "lengthening"]
    assert not any(isinstance(each, PolyCollection) for each in axes.collections)
    assert part.get_suptitle() == "without a name: error of strut 3, cause unknown"


def test_what_is_of_the_reading_is_no_struts():
    part, axes = panel(curve(Follows("angle", "", READING), "deg", [0.0, 10.0], [1.0, 2.0], [0.1, 0.1], None))
    assert (part.get_suptitle(), axes.get_xlabel()) == (
        "without a name: error of the reading, cause unknown",
        "angle, °",
    )


def test_nothing_to_find(reference):
    said = texts(drawing(joint_fit(reference, ())))
    assert "The recordings agree with the kinematic model" in said
    assert not any("error over" in text for text in said)
