"""The report's colours can be read, and its drawings stay small and keep what counts."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from dbbstation.circles.path import Filter
from dbbstation.files.places import shipped_folder
from dbbstation.report.polar import BINS, CIRCLE, MOST_DRAWN, REACH, SIZE, _points, polar, step_of
from dbbstation.results.tolerances import Conformity, Size, conformity
from dbbstation.tasks.circle_runs import load_circles

STYLE = (resources.files("dbbstation.report") / "templates" / "style.css").read_text("utf-8")
TEXT, LINES = {"ink", "soft", "good", "bad", "open", "link"}, {"ccw", "cw", "former"}


def palettes():
    blocks = re.findall(r":root \{([^}]*)\}", STYLE)
    assert len(blocks) == 2
    light, dark = (dict(re.findall(r"--([a-z]+): #([0-9a-f]{6})", block)) for block in blocks)
    assert set(light) == set(dark)
    return {"light": light, "dark": dark}


def luminance(colour):
    """Relative luminance [WCAG 2.2]."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))


def contrast(one, other):
    """Contrast ratio [WCAG 2.2]."""
    low, high = sorted([luminance(one), luminance(other)])
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_what_the_guideline_says():
    assert contrast("000000", "ffffff") == pytest.approx(21.0)
    assert contrast("767676", "ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_can_be_read(theme):
    """4.5 for text, 3 for lines that mean something [WCAG 2.2, 1.4.3 and 1.4.11]."""
    colours = palettes()[theme]
    for ground in ("page", "card"):
        for name in TEXT:
            assert contrast(colours[name], colours[ground]) >= 4.5, (theme, name, ground)
        for name in LINES:
            assert contrast(colours[name], colours[ground]) >= 3.0, (theme, name, ground)


def test_no_direction_is_told_by_colour_alone():
    assert re.search(r"\.cw \{[^}]*stroke-dasharray", STYLE)


@pytest.mark.parametrize(
    ("most", "step"), [(0.37, 0.2), (0.5, 0.5), (1.0, 1.0), (1.9, 1.0), (4.99, 2.0), (5.0, 5.0), (73.0, 50.0)]
)
def test_divisions_are_round(most, step):
    assert step_of(most) == pytest.approx(step)


def test_a_long_recording_is_drawn_small_and_its_peak_stays():
    theta = np.linspace(0.0, 360.0, 60_000, endpoint=False)
    deviation = np.zeros(len(theta))
    deviation[12_345] = 10.0
    points = np.array([[float(v) for v in one.split(",")] for one in _points(theta, deviation, REACH / 10.0).split()])
    assert len(points) <= 2 * BINS
    radius = np.hypot(*(points - SIZE / 2).T)
    assert radius.max() == pytest.approx(CIRCLE + REACH, abs=0.1)
    assert np.sort(radius)[-2] == pytest.approx(CIRCLE, abs=0.1)
    peak = points[np.argmax(radius)] - SIZE / 2
    assert np.degrees(np.arctan2(-peak[1], peak[0])) == pytest.approx(theta[12_345], abs=0.1)


def test_of_a_hundred_repeats_the_last_are_drawn():
    found = load_circles([shipped_folder("fixtures") / "sessions" / "small"], Filter.NONE, ["g"])
    runs = [replace(one, entry=replace(one.entry, repeat=k)) for k in range(1, 101) for one in found.circles]
    drawn = polar("g", runs)
    assert len(drawn.traces) == 2 * MOST_DRAWN
    assert drawn.not_drawn == 200 - 2 * MOST_DRAWN
    assert [trace.thin for trace in drawn.traces].count(False) == 2
    assert sum(len(trace.points) for trace in drawn.traces) < 2 * MOST_DRAWN * 2 * BINS * len("123.4,123.4 ")
    assert drawn.traces[-1].title.startswith("g cw 100: G ")


def test_a_limit_within_the_uncertainty_decides_nothing():
    """ISO 14253-1: conformity is proved where figure and U together keep the limit."""
    size = Size(um=10.0, u_um=0.5)
    said = {limit: conformity(size, limit, 2.0) for limit in (8.9, 9.1, 10.9, 11.0)}
    assert said == {
        8.9: Conformity.EXCEEDED,
        9.1: Conformity.UNDECIDED,
        10.9: Conformity.UNDECIDED,
        11.0: Conformity.WITHIN,
    }
