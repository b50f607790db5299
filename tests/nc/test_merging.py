"""Which short moves are one on a control: closed forms; what LinuxCNC makes of them is in `test_merged_on_the_planner`."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.kept import MergedMovesError
from dbbstation.nc.merging import MOST_POINTS, queued
from dbbstation.nc.planner import LookAhead, Planner
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind

STARTS = "G21 G90 G94\nG0 X0 Y0 Z-1000 A0 B0 C0\nF3000"


def path_of(control: str, body: str):
    return read_program(f"{STARTS}\n{control}\n{body}\nG61\nG1 Z-1001\nM2\n", "short.ngc")


def queued_lines(control: str, body: str) -> list[int]:
    """Numbers of the moves of the body that are queued, from 1."""
    path = path_of(control, body)
    one = queued(path)
    kept = path if one is None else one.path
    return sorted({int(line) - 4 for line in kept.line[kept.kind == RowKind.FEED]})[:-1]


def zigzag(height_mm: float, count: int = 8) -> str:
    return "\n".join(f"G1 X{k} Y{height_mm * (k % 2):.3f}" for k in range(1, count + 1))


@pytest.mark.parametrize(
    ("control", "merged"),
    [
        ("G64 P0.05", True),
        ("G64 P0.03", False),
        ("G64 P0.03 Q0.05", True),
        ("G64 P0.05 Q0.03", False),
        ("G64 P0.05 Q0", False),
        ("G64 Q0.05", True),
        ("G64", False),
        ("G61", False),
    ],
)
def test_points_within_q_are_one_line(control, merged):
    """Tips of 0.04 mm stand 0.04 mm off the line to the last point, which lies on the axis. Without Q, P counts; `rs274` prints that
    SET_NAIVECAM_TOLERANCE is Q, or P, or 0.
    """
    assert queued_lines(control, zigzag(0.04)) == ([8] if merged else list(range(1, 9)))


def test_a_circle_is_cut_where_a_point_would_leave_the_line_by_more_than_q():
    """Lines over k steps of an arc of R 20 mm leave it by R·(1 - cos(k·step/2)) at most, at even k; 0.05 mm are 22 steps of 0.2 mm."""
    at = 20.0 * (np.exp(-1j * 0.01 * np.arange(1, 200)) - 1.0) * 1j
    lines = queued_lines("G64 P0.05", "\n".join(f"G1 X{p.real:.6f} Y{p.imag:.6f}" for p in at))
    off_mm = 20.0 * (1.0 - np.cos(0.01 * np.diff([0, *lines]) / 2.0))
    one_more = 20.0 * (1.0 - np.cos(0.01 * (np.diff([0, *lines]) + 1) / 2.0))
    assert (off_mm[:-1] <= 0.05).all()
    # An odd number of steps has no point in the middle of its arc.
    assert (one_more[:-1] > 0.05 - 20.0 * 0.01**2 / 8.0).all()


def test_no_more_than_a_hundred_and_one_are_one():
    assert queued_lines("G64 P0.05", "\n".join(f"G1 X{0.1 * k:.1f}" for k in range(1, 251))) == [101, 202, 250]
    assert MOST_POINTS == 101


@pytest.mark.parametrize(
    ("between", "parts"),
    [
        ("F2000", True),
        ("F3000", False),
        ("G4 P0.1", True),
        ("M8", True),
        ("(MSG, look)", True),
        ("(a note)", False),
        ("G0 X4 Y0.01", True),
        ("G55", True),
        ("G3 X4 Y0 J1", True),
        ("G64 P0.06", True),
    ],
)
def test_what_stands_between_two_lines_parts_them(between, parts):
    lines = [f"G1 X{k} Y{0.02 * (k % 2):.2f}" for k in range(1, 9)]
    body = "\n".join([*lines[:4], between, *lines[4:]])
    assert (4 in queued_lines("G64 P0.05", body)) == parts


def test_a_move_that_turns_stays_by_itself():
    lines = [f"G1 X{k} Y0" + (" A0.1" if k == 4 else "") for k in range(1, 9)]
    assert queued_lines("G64 P0.05", "\n".join(lines)) == [3, 4, 8]


@pytest.mark.parametrize(("q_mm", "lines"), [(0.04, [2]), (0.026, [1, 2]), (0.0245, [])])
def test_an_arc_that_hardly_leaves_its_chord_is_two_lines(q_mm, lines):
    """R 5 mm over 1 mm: 5 - √(25 - 0.25) = 0.02506 mm. The middle of the second arc lies on the other side: the line to it is a
    third more than that, 0.0334 mm, from the middle of the first.
    """
    path = path_of(f"G64 P{q_mm}", "G2 X1 Y0 R5\nG3 X2 Y0 R5")
    one = queued(path)
    kept = path if one is None else one.path
    straight = (kept.kind == RowKind.FEED) & (kept.arc[:, 2] == 0.0)
    assert [int(line) - 4 for line in kept.line[straight]][:-1] == lines


def test_moves_that_are_one_take_its_time_by_their_lengths():
    """Ten lines of 0.1 to 1 mm in one direction, 5.5 mm: the time of one line from rest to rest, L/v + v/a."""
    ends = np.cumsum(np.arange(1, 11)) / 10.0
    path = path_of("G64 P0.05", "\n".join(f"G1 X{x:.1f}" for x in ends))
    took = Planner(5000.0, LookAhead(0.5)).seconds(path)
    rows = np.flatnonzero((path.kind == RowKind.FEED) & (path.poses[:, 2] == -1000.0))
    one = path_of("G64 P0.05", "G1 X5.5")
    expected_s = Planner(5000.0, LookAhead(0.5)).seconds(one)[one.poses[:, 2] == -1000.0].sum()
    assert took[rows].sum() == pytest.approx(expected_s)
    np.testing.assert_allclose(took[rows] / took[rows].sum(), np.arange(1, 11) / 55.0)


def test_what_is_said_on_the_way_is_said_before_the_line():
    lines = zigzag(0.04).splitlines()
    path = path_of(
        "G64 P0.05", "\n".join([*lines[:3], "(first)", *lines[3:5], "(second)", *lines[5:], "M8", "(third)"])
    )
    one = queued(path)
    assert one is not None
    words = [one.path.text.get(row, "") for row in range(len(one.path))]
    line = next(row for row in range(len(words)) if one.path.poses[row, 0] == 8.0)
    assert [word.strip() for word in words[line - 2 : line + 3]] == ["first", "second", "", "M8", "third"]
    np.testing.assert_array_equal(one.path.before[line, :2], [0.0, 0.0])


HILLS = "\n".join(f"G1 X{0.1 * k:.1f} Z{-1000.0 + 0.2 * np.sin(0.2 * np.pi * k):.4f}" for k in range(1, 401))


@pytest.mark.parametrize(("control", "merges"), [("G64 P0.25", True), ("G64 P0.25 Q0", False)])
def test_lines_are_merged_where_the_control_would_be_faster_otherwise(control, merges, linuxcnc, crooked):
    """Hills of 0.2 mm, 2 mm apart, are 10 % longer than the line across them that the control runs within P."""
    path = path_of(control, HILLS)
    slow = replace(crooked.machine, acceleration_mm_s2=1000.0)
    done = compensated_program(
        path, linuxcnc, Inverse(MachineModel(slow, crooked.sources), prefer=Prefer.POSITION_ONLY)
    )
    assert ("made one within" in done.text) == merges
    if merges:
        assert done.feed_s <= 1.01 * done.nominal_feed_s
        assert done.merged_um == pytest.approx(farthest_um(path))
    else:
        assert done.merged_um is None
        assert done.points >= 400


def test_by_itself_no_point_of_a_program_is_left_out(linuxcnc, crooked):
    """It is refused with what to do, and --prefer accuracy goes through all 400 points."""
    model = MachineModel(replace(crooked.machine, acceleration_mm_s2=1000.0), crooked.sources)
    path = path_of("F300\nG64 P0.25", HILLS)
    with pytest.raises(MergedMovesError, match=r"write Q0 behind P .* --prefer accuracy"):
        compensated_program(path, linuxcnc, Inverse(model))
    each = compensated_program(path, linuxcnc, Inverse(model, prefer=Prefer.ACCURACY))
    assert each.points >= 400
    assert each.merged_um is None


def farthest_um(path) -> float:
    """Distance of the points that are left out from the lines that are queued, point by point [µm]."""
    ends = [line for line in queued_lines("G64 P0.25", HILLS) if line <= 400]
    points = path.poses[(path.kind == RowKind.FEED) & (path.poses[:, 2] > -1000.9)][:, [0, 2]]
    points = np.vstack([[0.0, -1000.0], points])
    worst_mm = 0.0
    for first, last in pairwise([0, *ends]):
        line = points[last] - points[first]
        for inner in range(first + 1, last):
            share = np.clip((points[inner] - points[first]) @ line / (line @ line), 0.0, 1.0)
            worst_mm = max(worst_mm, float(np.linalg.norm(points[inner] - points[first] - share * line)))
    return 1e3 * worst_mm


def test_compensated_pieces_are_not_merged(linuxcnc):
    path = path_of("G64 P0.05", zigzag(0.04))
    rows = np.arange(len(path))
    assert not path.divided(rows, path.poses).merges_mm.any()
    assert not read_program(linuxcnc.write(path), "written.ngc").merges_mm.any()
