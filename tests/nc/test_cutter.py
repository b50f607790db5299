"""Beside a contour (G41, G42): the tool's centre by hand, and of drawn contours as LinuxCNC's interpreter has it."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.toolpath import Toolpath
from dbbstation.tasks.programs import setup_of
from tests.nc.interpreter import events, needs_rs274
from tests.nc.test_fuzz_rs274 import difference

COUNT, MOST_ONLY_BY_US = 120, 0.04
TOOL = ControlSetup(diameters={1: 4.0, 2: -4.0})
HEAD = "G21 G90 G94 G17 F300\nG0 X0 Y-20 Z0 A0 B0 C0\n"


def corners(body: str) -> np.ndarray:
    """Ends of straight moves and of arcs in X and Y after the first rapid, with full turns left out."""
    path = read_program(f"{HEAD}{body}M2\n", "part.ngc", setup=TOOL)
    moves = path.poses[path.is_move][1:]
    arc = path.arc[path.is_move][1:]
    ends = np.append(np.any(arc[1:] != arc[:-1], axis=1) | (arc[1:, 2] == 0.0), True)
    return moves[ends, :2]


@pytest.mark.parametrize(
    ("code", "sign"), [("G41 D1", 1.0), ("G42 D1", -1.0), ("G42 D2", 1.0), ("G41.1 D4", 1.0), ("M61 Q1 G41", 1.0)]
)
def test_the_centre_runs_a_radius_beside_a_line(code, sign):
    ends = corners(f"{code}\nG1 Y0\nY30\nG40\nG1 X9 Y40\n")
    np.testing.assert_allclose(ends[-3:], [[-2.0 * sign, 0.0], [-2.0 * sign, 30.0], [9.0, 40.0]], atol=1e-12)


def test_it_cuts_an_inner_corner_short_and_goes_round_an_outer_one():
    ends = corners("G41 D1\nG1 Y0\nX-30\nY30\nG40 G1 X0 Y0\n")
    np.testing.assert_allclose(ends, [[-2.0, -2.0], [-30.0, -2.0], [-32.0, 0.0], [-32.0, 30.0], [0.0, 0.0]], atol=1e-12)


def test_inside_and_outside_an_arc_its_radius_changes_by_the_tool():
    for side, radius in (("G41", 8.0), ("G42", 12.0)):
        path = read_program(f"{HEAD}{side} D1\nG1 Y0\nG3 X-20 I-10\nG40\nG1 X0 Y0\nM2\n", "part.ngc", setup=TOOL)
        chords = path.poses[path.arc[:, 2] != 0.0]
        np.testing.assert_allclose(np.hypot(chords[:, 0] + 10.0, chords[:, 1]), radius, atol=1e-12)


def test_a_dive_at_an_inner_corner_goes_down_where_the_corner_is():
    path = read_program(f"{HEAD}G41 D1\nG1 Y0\nZ-1\nX-30\nG40 G1 X0 Y0\nM2\n", "part.ngc", setup=TOOL)
    np.testing.assert_allclose(path.poses[1:3], [[-2, -2, 0, 0, 0, 0], [-2, -2, -1, 0, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("G41 D1\nG1 Y-19\n", "no room"),
        ("G41 D1\nG1 Y0\nX-1\nY10\nX-1.5\nY0\n", "no room"),
        ("G41 D1\nG1 Y0\nG3 X-2 I-1\n", "no room"),
        ("G41 D7\nG1 Y0\n", "the diameter of tool 7 is not known"),
        ("G41\nG1 Y0\n", "the diameter of tool in the spindle is not known"),
        ("G19 G41 D1\n", "in G19"),
        ("G41 D1\nG42 D1\n", "while another one is in force"),
        ("G41 D1\nG1 Y0\nG54\n", "changes what moves mean"),
        ("G41 D1\nG1 Y0\nG98 G81 X5 Z-1 R1\n", "a cycle beside a contour"),
        ("G41 D1\nG1 Y0\nG40\nG3 X5 R9\n", "the move behind G40 is an arc"),
        ("G41.1\nG1 Y0\n", "needs D"),
    ],
)
def test_what_a_cutter_cannot_follow_is_refused(body, says):
    with pytest.raises(InputError, match=says):
        corners(body)


def test_lengths_and_diameters_stand_in_the_tool_table(tmp_path):
    table = tmp_path / "tool.tbl"
    table.write_text("T1 P1 D6.0 Z12.5 ;mill\nT2 P2 Z-3\n")
    setup = setup_of({}, {2: 4.0}, None, table)
    assert setup.diameters == {1: 6.0}
    assert setup.lengths == {1: (0.0, 0.0, 12.5, 0.0, 0.0, 0.0), 2: (0.0, 0.0, 4.0, 0.0, 0.0, 0.0)}


def test_the_header_says_for_which_diameter_a_program_is_right(linuxcnc, crooked):
    path = linuxcnc.toolpath(f"{HEAD.replace('Z0', 'Z-1000')}G41 D1\nG1 Y0\nY30\nG40\nM2\n", "part.ngc", setup=TOOL)
    assert "; right for the diameter of tool 1: 4\n" in compensated_program(path, linuxcnc, Inverse(crooked)).text


def contour(seed: int) -> str:
    """A contour of lines, rapids, arcs and dives in G17 or G18 with a tool beside it."""
    draw = random.Random(seed)  # noqa: S311 - the same contours each time
    first, second, third, one, other = draw.choice(["XYZIJ", "ZXYKI"])
    lines = [f"{'G17' if first == 'X' else 'G18'} G21 G90 G40 F{draw.randint(50, 900)}", "G0 X0 Y0 Z0 A0 B0 C0"]
    lines.append(f"{draw.choice(['G41.1', 'G42.1'])} D{draw.uniform(0.5, 6.0):.3f}")
    x = y = angle = 0.0
    for _ in range(draw.randint(2, 9)):
        kind, length = draw.choices(["G1", "dive", "G0", "R", "centre"], [4, 1, 1, 2, 2])[0], draw.uniform(3.0, 25.0)
        angle += draw.uniform(-2.2, 2.2) * (draw.random() < 0.8)
        to_x, to_y = x + length * math.cos(angle), y + length * math.sin(angle)
        code, more = (kind, "") if kind[0] == "G" else (draw.choice(["G2", "G3"]), "")
        if kind == "dive":
            lines += [f"{draw.choice(['G0', 'G1'])} {third}{draw.uniform(0.1, 3.0):.3f}", "G4 P0.1"]
            continue
        if kind == "R":
            more = f" R{length / 2.0 * draw.uniform(1.05, 3.0) * draw.choice([1, 1, -1]):.4f}"
        elif kind == "centre":
            turn, spanned = 1.0 if code == "G3" else -1.0, draw.uniform(0.3, 5.5)
            i, j = length * math.cos(angle + turn * math.pi / 2.0), length * math.sin(angle + turn * math.pi / 2.0)
            at = math.atan2(-j, -i) + turn * spanned
            to_x, to_y = x + i + length * math.cos(at), y + j + length * math.sin(at)
            more, angle = f" {one}{i:.5f} {other}{j:.5f}", angle + turn * spanned
        lines.append(f"{code} {first}{to_x:.4f} {second}{to_y:.4f}{more}")
        x, y = round(to_x, 4), round(to_y, 4)
    lines += [draw.choice(["G40", f"G40 G1 {first}30 {second}30"]), "G0 X0 Y0 Z9", "M2"]
    return "\n".join(lines) + "\n"


@needs_rs274
@pytest.mark.slow
def test_drawn_contours_are_followed_as_linuxcnc_follows_them(tmp_path):
    equal, only_we_refuse = 0, []
    for seed in range(COUNT):
        text = contour(seed)
        they = events(text, tmp_path)
        try:
            we: Toolpath | InputError = read_program(text, "drawn.ngc")
        except InputError as error:
            we = error
        if isinstance(we, InputError):
            only_we_refuse += [] if they is None else [(seed, str(we))]
            continue
        assert they is not None, f"seed {seed}: LinuxCNC refuses\n{text}"
        differs = difference(we, they)
        assert not differs, f"seed {seed}: {differs}\n{text}"
        equal += 1
    assert equal > 0.6 * COUNT
    assert len(only_we_refuse) < MOST_ONLY_BY_US * COUNT, only_we_refuse
