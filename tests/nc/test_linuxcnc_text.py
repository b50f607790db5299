"""The exact text of small programs, worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.dialects.linuxcnc import guard_lines
from dbbstation.nc.toolpath import IN_FORCE, RowKind, ToolpathBuilder
from dbbstation.nc.words import digits
from dbbstation.plan.plan import Circle, Direction

SMALL = Circle(
    ball_mm=(10.0, 20.0, -1100.0),
    centre_mm=(10.0, 20.0, -1100.0),
    bar_mm=100.0,
    tilt_deg=(5.0, -2.5, 0.0),
    feed_mm_min=600.0,
    start_deg=0.0,
    overshoot_deg=90.0,
    feed_in_mm=2.0,
    elevation_deg=0.0,
    direction=Direction.CCW,
)

GUARD = "\n".join(guard_lines({IN_FORCE: (0.0,) * 6}))

# From 270 degrees (-Y) counter-clockwise through 540 degrees to 90 degrees (+Y), a point every 90 degrees. The chord
# error is 100 (1 - cos 45°) = 29.289322 mm, and as much may be cut off the corners.
GOLDEN = f"""\
; a small circle
; 0.1 um, [1...]
{GUARD}
G21 G90 G94 G17 G40 G49
G64 P29.28932 Q0
G0 X10.000000 Y-82.000000 Z-1080.000000 A5.0000000 B-2.5000000 C0.0000000
G1 Z-1100.000000 F600
(MSG, put the bar on its balls, start recording, then continue)
M0
G4 P1
G1 Y-80.000000
G4 P0.3
G1 X110.000000 Y20.000000
G1 X10.000000 Y120.000000
G1 X-90.000000 Y20.000000
G1 X10.000000 Y-80.000000
G1 X110.000000 Y20.000000
G1 X10.000000 Y120.000000
G4 P0.3
G1 Y122.000000
G4 P1
(MSG, stop recording, take the bar off, then continue)
M0
G0 Z-1080.000000
M2
"""


def test_a_small_circle_reads_as_worked_out_by_hand(linuxcnc):
    path = circle_toolpath(SMALL, "small", step_deg=90.0)
    assert linuxcnc.write(path, ["a small circle", "0.1 µm, [1…]"]) == GOLDEN


def test_with_the_bar_on_there_are_no_rapids_and_no_stops(linuxcnc):
    lines = linuxcnc.write(circle_toolpath(SMALL, "small", step_deg=90.0, clearance_mm=None)).splitlines()
    lines = lines[lines.index("G21 G90 G94 G17 G40 G49") :]
    assert lines[2] == "G1 X10.000000 Y-82.000000 Z-1100.000000 A5.0000000 B-2.5000000 C0.0000000 F600"
    assert lines[3] == "G4 P1"
    assert lines[-2:] == ["G4 P1", "M2"]
    assert not any(line.startswith(("G0", "M0")) for line in lines)


def test_clockwise_runs_the_same_points_backwards():
    there = circle_toolpath(SMALL, "ccw", step_deg=30.0)
    back = circle_toolpath(replace(SMALL, direction=Direction.CW), "cw", step_deg=30.0)
    arc, other = (path.poses[path.kind == RowKind.FEED][1:-1] for path in (there, back))
    np.testing.assert_allclose(other, arc[::-1], atol=1e-9)


def test_the_full_turn_has_3600_points_and_the_path_begins_and_ends_outside(all_runs):
    for circle in all_runs:
        path = circle_toolpath(circle, "x")
        feeds = path.poses[path.kind == RowKind.FEED]
        from_ball = np.linalg.norm(feeds[:, :3] - circle.ball_mm, axis=1)
        assert len(feeds) == 1 + 1 + 3600 + 900 + 1
        np.testing.assert_allclose(from_ball[1:-1], circle.bar_mm, atol=1e-9)
        np.testing.assert_allclose(from_ball[[0, -1]], circle.bar_mm + circle.feed_in_mm, atol=1e-9)


def test_the_bar_stays_one_line_with_the_path_when_it_is_raised():
    height = -1100.0 + 100.0 * np.sin(np.radians(5.0))
    raised = replace(SMALL, elevation_deg=5.0, centre_mm=(10.0, 20.0, height))
    path = circle_toolpath(raised, "raised")
    feeds = path.poses[path.kind == RowKind.FEED]
    outside, first = feeds[0, :3] - raised.ball_mm, feeds[1, :3] - raised.ball_mm
    np.testing.assert_allclose(outside / 102.0, first / 100.0, atol=1e-12)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1000.0, "1000"),
        (0.5, "0.5"),
        (1234.56789, "1234.568"),
        (0.000123456789, "0.0001234568"),
        (12345678.9, "12345679"),
        (0.0, "0"),
    ],
)
def test_feeds_have_seven_digits_and_no_exponent(value, text):
    assert digits(value) == text


def test_a_header_cannot_break_the_program(linuxcnc):
    path = ToolpathBuilder("x")
    path.rapid(np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0]))
    text = linuxcnc.write(path.built(), ["two\nlines (and) a\ttab", "x" * 500])
    first, second, *_ = text.splitlines()
    assert first == "; two lines (and) a tab"
    assert len(second) < 255


def test_nothing_rounds_to_minus_zero(linuxcnc):
    path = ToolpathBuilder("x")
    path.rapid(np.array([-1e-9, -0.0, -1000.0, -1e-12, 0.0, 0.0]))
    assert "-0.000" not in linuxcnc.write(path.built())


@pytest.mark.parametrize(("corner_mm", "line"), [(0.0, "G61"), (np.inf, "G64"), (0.01, "G64 P0.01 Q0"), (None, "G0")])
def test_path_control_says_how_far_corners_may_be_rounded(linuxcnc, corner_mm, line):
    path = ToolpathBuilder("x")
    path.corner_mm = corner_mm
    path.rapid(np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0]))
    assert linuxcnc.write(path.built()).splitlines()[1].startswith(line)
    assert linuxcnc.read(linuxcnc.write(path.built()), "x.ngc").corner_mm == corner_mm
