"""What moves take on LinuxCNC as it is reckoned here: closed forms, and speeds against a profile in small steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.nc import rapids
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.planner import LookAhead, Planner
from dbbstation.nc.toolpath import RowKind

A = 1000.0
PLANNER = Planner(A, LookAhead(0.5))
OF_AN_ARC = 0.75**0.5


def seconds(linuxcnc, body: str) -> np.ndarray:
    """Time of each move at feed of a program [s]; chords of an arc together."""
    path = linuxcnc.read(f"G21 G90 G94\n{body}\nM2\n", "timed.ngc")
    took, at_feed = PLANNER.seconds(path), path.kind == RowKind.FEED
    lines = np.unique(path.line[at_feed])
    return np.array([took[at_feed & (path.line == line)].sum() for line in lines])


START = "G0 X0 Y0 Z-1000 A0 B0 C0\nF1200"


@pytest.mark.parametrize(
    ("control", "ramps"),
    [("G61", 1.0), ("G64 P0.01", 2.0)],
    ids=["exact: all of the acceleration", "nothing follows: half of it"],
)
def test_a_line_alone(linuxcnc, control, ramps):
    """50 mm at v = 20 mm/s: L/v and v/a for both ramps; LinuxCNC took 0.647 s in place of 0.458 s for 26 mm at 0.5 m/s²."""
    assert seconds(linuxcnc, f"{control}\n{START}\nG1 X50") == pytest.approx([50 / 20 + ramps * 20 / A])


def test_a_line_before_a_rapid_stops(linuxcnc):
    assert seconds(linuxcnc, f"G64 P0.01\n{START}\nG1 X50\nG0 Z-900") == pytest.approx([50 / 20 + 20 / A])


def test_lines_in_one_direction_are_one(linuxcnc):
    parted = seconds(linuxcnc, f"G64 P0.01\n{START}\nG1 X10\nG1 X30\nG1 X50\nG0 Z-900")
    assert parted.sum() == pytest.approx(50 / 20 + 20 / A)


@pytest.mark.parametrize(
    ("way_deg", "kink_deg", "stops"), [(0.0, 0.0, 0), (0.0, 0.265, 0), (0.0, 0.275, 1), (45.0, 0.275, 0)]
)
def test_an_exact_path_stops_in_corners_alone(linuxcnc, way_deg, kink_deg, stops):
    """At v = 20 mm/s a kink of 0.1·a / (v/(1 ms) + a) can be run, 0.273 degrees along an axis and 0.386 across two.

    LinuxCNC ran 0.265 degrees and stopped at 0.275, and ran 0.275 across two axes; at 5 m/s² (1.146 degrees) it ran 1.12 and stopped at 1.18, at F3000 and
    1 m/s² (0.1123 degrees) it ran 0.1 and stopped at 0.118. The kink takes its share of the acceleration: ramps of v/a are as much longer.
    """
    first, on = np.radians(way_deg), np.radians(way_deg + kink_deg)
    corner = 10 * np.exp(1j * first)
    end = corner + 10 * np.exp(1j * on)
    lines = [f"G1 X{at.real:.9f} Y{at.imag:.9f}" for at in (corner, end)]
    took = seconds(linuxcnc, "\n".join(["G61", START, *lines]))
    asked = (
        0.0
        if stops
        else (20 / 0.001 + A) / A * np.abs(np.array([(on - first) * np.sin(first), (on - first) * np.cos(first)])).max()
    )
    assert took.sum() == pytest.approx(20 / 20 + (1 + stops) * 20 / (A * (1.0 - asked)), rel=1e-4)


def test_an_exact_path_goes_on_from_a_line_into_its_circle(linuxcnc):
    straight, turning = (
        seconds(linuxcnc, f"G61\nG0 X0 Y0 Z-1000 A0 B0 C0\nF120\nG1 X10{word}\nG3 J5").sum() for word in ("", " A1")
    )
    assert straight == pytest.approx((10 + 2 * np.pi * 5) / 2.0 + 2.0 / A, rel=1e-5)
    assert turning > straight + 0.9 * 2.0 / A


def test_an_exact_path_stops_where_the_circle_is_written_in_chords(linuxcnc):
    """Its first chord, 0.8 degrees of R 2 mm, meets the line in half of that, more than 0.26: one ramp down, one up, v/a."""
    path = linuxcnc.read("G21 G90 G94\nG61\nG0 X0 Y0 Z-1000 A0 B0 C0\nF1200\nG1 X10\nG3 J2\nM2\n", "timed.ngc")
    written = PLANNER.seconds(path, in_chords=True).sum() - PLANNER.seconds(path).sum()
    assert written == pytest.approx(20.0 / A, rel=0.2)  # in the circle the acceleration is a little less


def test_a_corner_is_an_arc_within_its_bound(linuxcnc):
    """90 degrees, P 0.05 mm: R = P·cos 45°/(1 - cos 45°); v² = 0.866·a·R; the arc takes R off both lines."""
    bound, half = 0.05, 0.5**0.5
    radius = bound * half / (1.0 - half)
    corner = (OF_AN_ARC * A * radius) ** 0.5
    one = (40.0 - radius) / 20.0 + (20.0**2 / 2 + (20.0 - corner) ** 2 / 2) / (A * 20.0)
    arc = radius * np.pi / 2 / corner
    took = seconds(linuxcnc, f"G64 P{bound}\n{START}\nG1 X40\nG1 Y40\nG0 Z-900")
    assert took.sum() == pytest.approx(2 * one + arc)


def test_a_move_takes_one_and_a_half_servo_cycles_at_least(linuxcnc):
    """0.06 mm at F6000 would be 0.6 cycles of 1 ms."""
    lines = "\n".join(f"G1 X{0.06 * (1 + k):.2f}" for k in range(1000))
    took = seconds(linuxcnc, f"G64 P0.0001 Q0\nG0 X0 Y0 Z-1000 A0 B0 C0\nF6000\n{lines}")
    np.testing.assert_allclose(took[400:600], 0.0015)


def test_an_arc_is_as_fast_as_its_radius_allows(linuxcnc):
    """R 3 mm at F6000: v² = 0.866·a·R, with a tangential acceleration of half; it was reckoned as 137 chords with a ramp in each."""
    v = (OF_AN_ARC * A * 3.0) ** 0.5
    took = seconds(linuxcnc, "G61\nG0 X3 Y0 Z-1000 A0 B0 C0\nG3 X3 Y0 I-3 J0 F6000")
    way = 2 * np.pi * 3.0
    np.testing.assert_allclose(took, [way / v + v / (0.5 * A)], rtol=1e-5)


def test_circles_that_touch_and_turn_back_stop_between(linuxcnc):
    """R 2 and 4 mm at v = 2 mm/s: way/v, and v/2a for the ramp at each end. Chords meet in a corner that is not quite a reversal; under G64 without P it was rounded by half of the shorter circle."""
    took = seconds(linuxcnc, "G64\nG0 X0 Y0 Z-1000 A0 B0 C0\nF120\nG3 I2\nG2 I4\nG0 Z-900")
    v = 2.0
    ramps = 2 * v / (2 * A)
    # Chords within a micrometre are shorter than the circle by a hundred-thousandth.
    np.testing.assert_allclose(took, 2 * np.pi * np.array([2.0, 4.0]) / v + ramps, rtol=2e-5)


def test_a_line_that_touches_a_circle_goes_on_into_it(linuxcnc):
    """Along the tangent there is no corner: one ramp up, one down. v = 2 mm/s is reached in 2 µm."""
    took = seconds(linuxcnc, "G64 P0.01\nG0 X0 Y0 Z-1000 A0 B0 C0\nF120\nG1 X10\nG3 J5\nG0 Z-900")
    assert took.sum() == pytest.approx((10 + 2 * np.pi * 5) / 2.0 + 2.0 / A, rel=1e-5)


def test_a_short_move_is_one_with_the_arc_in_its_corner(linuxcnc):
    """0.1 mm from rest, then 3 degrees: the arc begins in its middle. Both have half of the acceleration."""
    length, angle = 0.1, np.radians(3.0)
    radius = length / 2.0 / np.tan(angle / 2.0)
    on = f"X{length + 20 * np.cos(angle):.9f} Y{20 * np.sin(angle):.9f}"
    took = seconds(linuxcnc, f"G64 P0.01 Q0\n{START}\nG1 X{length}\nG1 {on}\nG0 Z-900")
    way = length / 2.0 + radius * angle
    v = (A * way) ** 0.5  # half of the acceleration
    on_mm = 20.0 - length / 2.0
    rest = on_mm / 20.0 + (20.0**2 / 2.0 + (20.0 - v) ** 2 / 2.0) / (A * 20.0)
    assert took.sum() == pytest.approx(2.0 * way / v + rest, rel=1e-5)


@pytest.mark.parametrize(("length", "evenly"), [(0.28, True), (0.32, False)])
def test_a_move_that_ends_within_ten_milliseconds_changes_speed_evenly(linuxcnc, length, evenly):
    """From 10 to 50 mm/s at 5 m/s²: 8 ms with all of the acceleration. 2L/(v1 + v2) is 9.3 and 10.7 ms; LinuxCNC took 9.3 ms for the one and 8 for the other."""
    planner = Planner(5000.0, LookAhead(0.5))
    lines = f"G1 X5 F600\nG1 X{5 + length} F3000\nG1 X20"
    path = linuxcnc.read(f"G21 G90 G94\nG64 P0.01 Q0\nG0 X0 Y0 Z-1000 A0 B0 C0\n{lines}\nM2\n", "even.ngc")
    took = planner.seconds(path)[path.kind == RowKind.FEED][1]
    ramp_s = 40.0 / 5000.0
    assert took == pytest.approx(2 * length / 60.0 if evenly else ramp_s + (length - 30.0 * ramp_s) / 50.0, rel=1e-3)


def test_an_arc_in_a_corner_changes_from_one_speed_to_the_other(linuxcnc):
    """From 10 to 20 mm/s with half of the acceleration: 90 degrees, P 0.4 mm at 5 m/s² would allow 65 mm/s."""
    planner = Planner(5000.0, LookAhead(0.5))
    lines = "G1 X20 F600\nG1 Y20 F1200"
    path = linuxcnc.read(f"G21 G90 G94\nG64 P0.4\nG0 X0 Y0 Z-1000 A0 B0 C0\n{lines}\nG0 Z-900\nM2\n", "turn.ngc")
    bound = 0.4 * 0.5**0.5 / (1.0 - 0.5**0.5)
    as_long = 20.0 * 20.0 / (5000.0 / 2.0) / (np.pi / 2)  # as long as it would take without an arc
    radius = max(20.0**2 / (OF_AN_ARC * 5000.0), min(as_long, bound))
    arc = radius * np.pi / 2
    ramp_s = 10.0 / 2500.0
    on_arc = 2 * arc / 30.0 if 2 * arc / 30.0 < 0.01 else ramp_s + (arc - 15.0 * ramp_s) / 20.0
    straight = (20.0 - radius) / 10.0 + 10.0 / (2 * 5000.0) + (20.0 - radius) / 20.0 + 20.0 / (2 * 5000.0)
    assert planner.seconds(path).sum() == pytest.approx(straight + on_arc, rel=1e-4)


def test_moves_that_turn_overlap(linuxcnc):
    """Two lines of 20 mm in one direction: both ramps 2v/a, the first with half the acceleration, the second exact: v/a for each."""
    took = seconds(linuxcnc, f"G64 P0.01\n{START}\nG1 X20 A0.001\nG1 X40 A0.003\nG0 Z-900")
    first, second = 20 / 20 + 40 / A, 20 / 20 + 20 / A
    overlap = 40 / A  # as long as the longer ramp takes; the second one is at v by then, after half of that way
    gone = 0.5 * 20.0 * overlap
    entered = overlap + (20.0 - gone - 20.0**2 / (2 * A)) / 20.0 + 20.0 / A
    assert took.sum() == pytest.approx(first - overlap + entered, rel=1e-3)
    assert took.sum() < first + second


def profile_s(lengths: np.ndarray, corners: np.ndarray, feed: float, mm_s2: float, step_mm: float = 0.001) -> float:
    """Time along lines with a speed at each corner, by the speed in small steps forwards and backwards."""
    places = np.round(np.cumsum(lengths) / step_mm).astype(int)
    limit = np.full(places[-1] + 1, feed)
    limit[0] = limit[-1] = 0.0
    limit[places[:-1]] = np.minimum(limit[places[:-1]], corners)
    for rows in (range(1, len(limit)), range(len(limit) - 2, -1, -1)):
        before = 0.0
        for row in rows:
            before = limit[row] = min(limit[row], (before**2 + 2 * mm_s2 * step_mm) ** 0.5)
    return float(np.sum(2.0 * step_mm / (limit[1:] + limit[:-1])))


@pytest.mark.parametrize("seed", range(6))
def test_speeds_at_corners_are_brought_into_line(linuxcnc, seed):
    drawn = np.random.default_rng(seed)
    lengths, turns = drawn.uniform(0.02, 3.0, 12).round(3), drawn.uniform(0.1, 1.2, 11)
    angle = np.concatenate([[0.0], np.cumsum(turns)])
    ends = np.cumsum(lengths[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    bound = 1e-7  # so that arcs in corners take nothing off
    lines = [f"G1 X{x:.9f} Y{y:.9f}" for x, y in ends]
    took = seconds(linuxcnc, "\n".join([f"G64 P{bound:.9f}", START, *lines, "G0 Z-900"])).sum()
    cosine = np.cos(turns / 2)
    arcs = (OF_AN_ARC * A * bound * cosine / (1.0 - cosine)) ** 0.5
    # Along the axis that changes most, at v/(1 ms) + a; LinuxCNC ran 1 degree of it at 5.8 mm/s (5.5), across two axes at 8.0 (7.7).
    turned = np.diff(np.exp(1j * angle))
    kinks = 20.0 * 0.1 * A / ((20.0 / 0.001 + A) * np.maximum(np.abs(turned.real), np.abs(turned.imag)))
    assert (kinks > arcs).all()
    took_by_steps = profile_s(lengths, kinks, 20.0, 0.9 * A)  # a tenth of the acceleration is for the kinks
    assert took == pytest.approx(took_by_steps, rel=0.003)


# Rapids.

UP_OVER_DOWN = """\
G21 G90 G94
{control}
G0 X0 Y0 Z-980 A0 B0 C0
G0 Z-998
G1 Z-1002 F400
G0 Z-980
G0 X30 Y10
G0 Z-998
G1 Z-1002
M2
"""


def rapids_of(linuxcnc, model, control: str) -> list[str]:
    text = UP_OVER_DOWN.format(control=control)
    done = compensated_program(linuxcnc.read(text, "holes.ngc"), linuxcnc, Inverse(model)).text
    return [
        line.split()[0] if line.startswith("G0") else line
        for line in done.splitlines()
        if line.startswith(("G0", "G6"))
    ]


def test_rapids_stop_where_an_overlap_is_not_worth_half_the_acceleration(linuxcnc, crooked):
    """Up 22 mm, over 32 mm, down 18 mm at 1 m/s²; the corners of 90 degrees allow 24 ms at once, and half the acceleration costs 110 ms."""
    model = replace(crooked, machine=replace(crooked.machine, acceleration_mm_s2=A))
    bound = "G64 P0.05 Q0"
    assert rapids_of(linuxcnc, model, "G64 P0.05") == [bound, "G0", "G0", "G61", "G0", "G0", bound, "G0"]


@pytest.mark.parametrize("control", ["", "G61"])
def test_rapids_go_on_as_they_did(control, linuxcnc, crooked):
    """Where the program does not say how far corners may be rounded that could not be said again; exact stops are there already."""
    model = replace(crooked, machine=replace(crooked.machine, acceleration_mm_s2=A))
    assert rapids_of(linuxcnc, model, control) == [*([control] if control else []), *["G0"] * 5]


def test_rapids_in_one_direction_are_one(linuxcnc, crooked):
    up = "G21 G90 G94\nG64 P0.05\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X5 F600\nG0 Z-990\n{between}G0 Z-960\nG0 Z-960 X30\nM2\n"
    counts = []
    for between in ("", "M8\n", "G64\n"):
        done = compensated_program(linuxcnc.read(up.format(between=between), "up.ngc"), linuxcnc, Inverse(crooked)).text
        counts.append(sum(line.startswith("G0 ") for line in done.splitlines()))
    assert counts == [3, 4, 4]


@pytest.mark.parametrize(("control", "said"), [("G64 P0.05", False), ("G64", True)])
def test_slower_rapids_are_said(linuxcnc, crooked, control, said):
    model = replace(crooked, machine=replace(crooked.machine, acceleration_mm_s2=A))
    done = compensated_program(
        linuxcnc.read(UP_OVER_DOWN.format(control=control), "holes.ngc"), linuxcnc, Inverse(model)
    )
    assert (done.rapid_s + done.feed_s > 1.01 * (done.nominal_rapid_s + done.nominal_feed_s)) is said
    assert ("with G64 P0.05" in done.slower_rapids) is said


def test_rapids_take_ramps(linuxcnc):
    """30 mm and 40 mm with stops: √(4L/a) each at 1 m/s², as the machine's limit of speed is far away."""
    text = "G21 G90 G94\nG61\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X5 F600\nG0 X35\nG1 X40\nG0 Y40\nM2\n"
    path = linuxcnc.read(text, "rapids.ngc")
    assert rapids.seconds(path, PLANNER, 1e5) == pytest.approx((4 * 30 / A) ** 0.5 + (4 * 40 / A) ** 0.5, rel=1e-6)
