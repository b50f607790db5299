"""What moves take on LinuxCNC as it is reckoned here: closed forms, and speeds against a profile in small steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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


@pytest.mark.parametrize(("kink_deg", "stops"), [(0.0, 0), (0.25, 0), (0.28, 1)])
def test_an_exact_path_stops_in_corners_alone(linuxcnc, kink_deg, stops):
    """At v = 20 mm/s a kink of 0.1·a·(1 ms)/v = 0.286 degrees can be run. LinuxCNC ran 0.26 degrees and stopped at 0.28; with 5 m/s² 1.0 and 1.3."""
    angle = np.radians(kink_deg)
    on = f"G1 X{10 + 10 * np.cos(angle):.9f} Y{10 * np.sin(angle):.9f}"
    took = seconds(linuxcnc, f"G61\n{START}\nG1 X10\n{on}")
    assert took.sum() == pytest.approx(20 / 20 + (1 + stops) * 20 / A, rel=1e-5)


def test_an_exact_path_goes_on_from_a_line_into_its_circle(linuxcnc):
    """And not where A moves in it."""
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


def test_an_arc_is_as_fast_as_its_radius_allows(linuxcnc):
    """R 3 mm at F6000: v² = 0.866·a·R, with a tangential acceleration of half; it was reckoned as 137 chords with a ramp in each."""
    v = (OF_AN_ARC * A * 3.0) ** 0.5
    took = seconds(linuxcnc, "G61\nG0 X3 Y0 Z-1000 A0 B0 C0\nG3 X3 Y0 I-3 J0 F6000")
    way = 2 * np.pi * 3.0
    np.testing.assert_allclose(took, [way / v + v / (0.5 * A)], rtol=1e-5)


def test_circles_that_touch_and_turn_back_stop_between(linuxcnc):
    """R 2 and 4 mm at v = 2 mm/s: way/v, v/2a for the ramp at one end and (v - c)²/2av at the other, where c is what a kink may be run with,
    0.1·a·(1 ms)/2. Chords meet in a corner that is not quite a reversal; under G64 without P it was rounded by half of the shorter circle."""
    took = seconds(linuxcnc, "G64\nG0 X0 Y0 Z-1000 A0 B0 C0\nF120\nG3 I2\nG2 I4\nG0 Z-900")
    v, c = 2.0, 0.05
    ramps = v / (2 * A) + (v - c) ** 2 / (2 * A * v)
    # Chords within a micrometre are shorter than the circle by a hundred-thousandth.
    np.testing.assert_allclose(took, 2 * np.pi * np.array([2.0, 4.0]) / v + ramps, rtol=2e-5)


def test_a_line_that_touches_a_circle_goes_on_into_it(linuxcnc):
    """Along the tangent there is no corner: one ramp up, one down. v = 2 mm/s is reached in 2 µm."""
    took = seconds(linuxcnc, "G64 P0.01\nG0 X0 Y0 Z-1000 A0 B0 C0\nF120\nG1 X10\nG3 J5\nG0 Z-900")
    assert took.sum() == pytest.approx((10 + 2 * np.pi * 5) / 2.0 + 2.0 / A, rel=1e-5)


def test_moves_that_turn_overlap(linuxcnc):
    """Two lines of 20 mm in one direction: both ramps 2v/a, the first with half the acceleration, the second exact: v/a for each."""
    took = seconds(linuxcnc, f"G64 P0.01\n{START}\nG1 X20 A0.001\nG1 X40 A0.003\nG0 Z-900")
    first, second = 20 / 20 + 40 / A, 20 / 20 + 20 / A
    overlap = 40 / A  # as long as the longer ramp takes; the second one is at v by then, after half of that way
    gone = 0.5 * 20.0 * overlap
    entered = overlap + (20.0 - gone - 20.0**2 / (2 * A)) / 20.0 + 20.0 / A
    assert took.sum() == pytest.approx(first - overlap + entered, rel=1e-3)
    assert took.sum() < first + second


def profile_s(lengths: np.ndarray, corners: np.ndarray, feed: float, step_mm: float = 0.001) -> float:
    """Time along lines with a speed at each corner, by the speed in small steps forwards and backwards."""
    places = np.round(np.cumsum(lengths) / step_mm).astype(int)
    limit = np.full(places[-1] + 1, feed)
    limit[0] = limit[-1] = 0.0
    limit[places[:-1]] = np.minimum(limit[places[:-1]], corners)
    for rows in (range(1, len(limit)), range(len(limit) - 2, -1, -1)):
        before = 0.0
        for row in rows:
            before = limit[row] = min(limit[row], (before**2 + 2 * A * step_mm) ** 0.5)
    return float(np.sum(2.0 * step_mm / (limit[1:] + limit[:-1])))


@pytest.mark.parametrize("seed", range(6))
def test_speeds_at_corners_are_brought_into_line(linuxcnc, seed):
    """Short lines with kinks of some degrees, too many for each to be reached at its own speed."""
    drawn = np.random.default_rng(seed)
    lengths, turns = drawn.uniform(0.02, 3.0, 12).round(3), drawn.uniform(0.1, 1.2, 11)
    angle = np.concatenate([[0.0], np.cumsum(turns)])
    ends = np.cumsum(lengths[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    bound = 1e-7  # so that arcs in corners take nothing off
    lines = [f"G1 X{x:.9f} Y{y:.9f}" for x, y in ends]
    took = seconds(linuxcnc, "\n".join([f"G64 P{bound:.9f}", START, *lines, "G0 Z-900"])).sum()
    cosine = np.cos(turns / 2)
    arcs = (OF_AN_ARC * A * bound * cosine / (1.0 - cosine)) ** 0.5
    kinks = 0.1 * A * 0.001 / (2.0 * np.sin(turns / 2))
    assert took == pytest.approx(profile_s(lengths, np.maximum(arcs, kinks), 20.0), rel=0.003)


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
