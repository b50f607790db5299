"""What a program says beside its moves is written as it was: each of these was lost or changed once."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.dialects.linuxcnc import guard_lines
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.setup import ZERO, ControlSetup
from dbbstation.nc.toolpath import IN_FORCE, PIECE_CORNER_MM, Ending
from tests.nc.interpreter import events, needs_rs274, printed

FIRST = "G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\n"


def written(linuxcnc, text: str) -> list[str]:
    return linuxcnc.write(replace(linuxcnc.read(text, "part.ngc"), holds=None)).splitlines()[1:]


@pytest.mark.parametrize(
    "line",
    [
        "S0.00001 M3",
        "S12345.678",
        "M1",
        "(MSG, look)",
        "(PRINT, here)",
        "(LOG, begun)",
        "(msg,small)",
        "(LOGOPEN, part.log)",
        "(LOGCLOSE)",
        "(MSG,  two blanks and a µ )",
        "G54",
        "G59.3",
        "M7",
        "M50 P0",
        "M51",
        "M52 P1",
        "M53 P0",
        "M62 P1",
        "M67 E0 Q-1.5",
        "M101",
        "M199 P1.5 Q-2",
        "M30",
    ],
)
def test_a_word_is_written_as_it_was(linuxcnc, line):
    assert line in written(linuxcnc, f"{FIRST}{line}\nG1 X1 F100\nM2\n")


def test_a_switch_that_stored_modes_would_set_back_is_refused(linuxcnc):
    """M70 stores overrides and feed stop [LinuxCNC, M70], and the program that is written restores none."""
    with pytest.raises(InputError, match=r"4:1: M50 between modes that are stored"):
        linuxcnc.read(f"{FIRST}M70\nM50 P0\nG1 X1 F100\nM72\nM2\n", "part.ngc")
    assert "M50 P0" in written(linuxcnc, f"{FIRST}M50 P0\nM70\nG91\nG1 X1 F100\nM72\nM2\n")


def test_a_message_has_the_values_that_its_parameters_had(linuxcnc):
    """What is written sets none of them; LinuxCNC prints six decimals."""
    text = f"{FIRST}#1=[2+3]\n#<deep>=-0.5\n(DEBUG, system #5220, hole #1 #<deep> #<else>)\nM2\n"
    assert "(DEBUG, system 1.000000, hole 5.000000 -0.500000 #<else>)" in written(linuxcnc, text)


@pytest.mark.parametrize(
    ("line", "comment"),
    [
        ("; (MSG, x)", "; (MSG, x)"),
        (";MSG, x", "; MSG, x"),
        ("( MSG , x)", "; MSG , x"),
        ("(MSG, x) (y)", "; MSG, x"),
    ],
)
def test_what_linuxcnc_takes_for_a_comment_stays_one(linuxcnc, line, comment):
    """Of several comments in brackets it acts on the last; behind a semicolon on none."""
    assert comment in written(linuxcnc, f"{FIRST}{line}\nM2\n")


@pytest.mark.parametrize("line", ["(PY, x=1)", ";py,x", "(pyrun, move)"])
def test_python_in_a_comment_is_refused(line):
    with pytest.raises(InputError, match=r"part\.ngc:3:.*runs Python"):
        read_program(f"{FIRST}{line}\nM2\n", "part.ngc")


def test_a_message_before_a_stop_is_written_as_it_was(linuxcnc):
    path = linuxcnc.read(FIRST + "(MSG, turn it)\nM0\n(msg,turn it)\nM0\nM2\n", "part.ngc")
    assert [path.text.get(row, "") for row in range(1, len(path))] == ["turn it", "msg,turn it", ""]
    assert linuxcnc.write(path).splitlines()[-5:] == ["(MSG, turn it)", "M0", "(msg,turn it)", "M0", "M2"]


@pytest.mark.parametrize(("end", "ending"), [("M2", Ending.STOP), ("M30", Ending.REWIND)])
def test_a_program_ends_as_it_did(linuxcnc, end, ending):
    path = linuxcnc.read(f"{FIRST}{end}\n", "part.ngc")
    assert path.ending is ending
    assert linuxcnc.write(path).splitlines()[-1] == end


def test_a_program_that_ends_with_its_text_is_not_given_an_m2(linuxcnc, crooked):
    """M2 stops spindle and coolant; the percent sign does not."""
    path = linuxcnc.read(f"%\n{FIRST}S100 M3\nG1 X1 F100\n%\n", "part.ngc")
    lines = linuxcnc.write(path).splitlines()
    assert (lines[0], lines[-1]) == ("%", "%")
    assert "M2" not in lines
    again = compensated_program(path, linuxcnc, Inverse(crooked)).text
    assert linuxcnc.read(again, "again.ngc").ending is Ending.TEXT


# Coordinate systems.


def test_moves_in_machine_coordinates_stay_so(linuxcnc):
    lines = written(linuxcnc, FIRST + "G53 G0 Z-950\nG0 X5\nG55 G0 X5\nG53 G1 X6 F100\nM2\n")
    assert lines[1:-1] == [
        "G53 G0 Z-950.000000",
        "G0 X5.000000",
        "G55",
        "G0 X5.000000",  # the same number in another system is another place
        "G53 G1 X6.000000 F100",
    ]


# The guard.


@pytest.mark.parametrize(
    "held", [{IN_FORCE: ZERO}, {"G54": (10.0, 0.0, -3.0, 0.0, 0.0, 0.0), "G92": (0.0, 1.5, 0.0, 0.0, 0.0, 0.0)}]
)
@pytest.mark.parametrize("change", [str, str.lower, lambda line: f"N5 {line}", lambda line: line.replace(" ", "\t")])
def test_a_guard_lets_pass_what_it_holds_for_and_nothing_else(held, change):
    lines = "\n".join(change(line) for line in guard_lines(held))
    setup = ControlSetup(places={name: values for name, values in held.items() if name != IN_FORCE})
    assert len(read_program(f"; part\n{lines}\n{FIRST}M2\n", "part.ngc", setup=setup)) > 0
    for name, values in setup.places.items():
        off = ControlSetup(places={**setup.places, name: (*values[:5], 0.001)})
        assert not read_program(f"; part\n{lines}\n{FIRST}M2\n", "part.ngc", setup=off).is_move.any()


OFFSETS = {
    "none": ({}, ""),
    "another system's": ({5220: 2, 5221: 10.0, 5230: 3.0}, ""),
    "x": ({5221: 10.0}, "work system in force"),
    "w": ({5229: 1.0}, "work system in force"),
    "rotation": ({5230: 0.5}, "work system in force"),
    "of G55 in force": ({5220: 2, 5243: 1.0}, "work system in force"),
    "rotation of G59.3": ({5220: 9, 5390: 1.0}, "work system in force"),
    "G92": ({5210: 1, 5211: 1.0}, "G92"),
    "G92 put aside": ({5210: 0, 5219: 1.0}, "G92"),
}


@needs_rs274
@pytest.mark.parametrize("which", OFFSETS)
@pytest.mark.parametrize("model", [None, "crooked"])
def test_a_ball_bar_program_stops_where_an_offset_is_not_zero(linuxcnc, table2, crooked, tmp_path, which, model):
    inverse = None if model is None else Inverse(crooked)
    (program, _) = circle_programs(table2, crooked.machine, linuxcnc, inverse=inverse, tests=["a"], clearance_mm=None)
    parameters, message = OFFSETS[which]
    made = printed(program.text, tmp_path, parameters)
    names = [name for name, _ in made]
    if not message:
        assert "PROGRAM_STOP" not in names
        assert names.count("STRAIGHT_FEED") > 70
        return
    assert not any(name.startswith("STRAIGHT") for name in names)
    assert [name for name in names if name.startswith("PROGRAM")] == ["PROGRAM_STOP", "PROGRAM_END"]
    (said,) = [arguments for name, arguments in made if name == "MESSAGE"]
    assert message in said


@needs_rs274
@pytest.mark.parametrize(("before", "stops"), [("G43.1 Z1", True), ("G43.1 Z1\nG49", False), ("T1 M6", False)])
def test_a_ball_bar_program_stops_where_a_tool_length_is_in_force(linuxcnc, table2, tmp_path, before, stops):
    text = linuxcnc.write(circle_toolpath(table2.tests["a"].circle, "a", step_deg=5.0, clearance_mm=None))
    made = printed(f"{before}\n{text}", tmp_path)
    assert any(name == "STRAIGHT_FEED" for name, _ in made) is not stops
    assert any(name == "MESSAGE" and "tool length" in said for name, said in made) is stops


# Tool changes.


@pytest.mark.parametrize("start", [None, np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0])])
def test_behind_a_tool_change_no_rapid_names_an_axis_that_the_program_does_not(linuxcnc, crooked, start):
    """The changer may have moved it: Z would go down to where it stood before, with a tool that may be longer."""
    text = f"{FIRST}G1 X5 F100\nT1 M6\nG0 X20\nY9\nG0 Z-990\nG1 Z-1000\nM2\n"
    done = compensated_program(linuxcnc.read(text, "x.ngc", start=start), linuxcnc, Inverse(crooked)).text.splitlines()
    change = done.index("T1 M6")
    across, along, down, cut = done[change + 1 : change + 5]
    assert "Z" not in across + along
    assert "Y" not in across
    assert "X20" in across.replace("X19.9", "X20")
    assert "Z" in down
    assert {"A", "B", "C"} <= {word[0] for word in f"{across} {along} {down} {cut}".split()}


# Path control.


def test_an_exact_stop_belongs_to_the_ends_of_the_written_move(linuxcnc, crooked):
    text = FIRST + "G61\nG1 X100 Y3 F500\nG64 P0.02\nX0\nG3 I20\nG61\nG3 I20\nM2\n"
    path = linuxcnc.read(compensated_program(linuxcnc.read(text, "x.ngc"), linuxcnc, Inverse(crooked)).text, "y.ngc")
    corners = path.corners_mm[path.is_move]
    assert np.isnan(corners[0])
    assert [corner for corner, _ in groupby(corners[1:])] == [PIECE_CORNER_MM, 0.0, 0.02, PIECE_CORNER_MM, 0.0]
    line, circle = np.flatnonzero(path.corners_mm == 0.0)
    np.testing.assert_allclose(path.poses[line, :2], [100.0, 3.0], atol=1.0)
    np.testing.assert_allclose(path.poses[circle, :2], [0.0, 3.0], atol=1.0)


@needs_rs274
def test_linuxcnc_sees_one_exact_end_for_each_exact_move(linuxcnc, crooked, tmp_path):
    text = FIRST + "G61\nG1 X100 Y3 F500\nG3 I20\nG1 X5\nM2\n"
    done = compensated_program(linuxcnc.read(text, "x.ngc"), linuxcnc, Inverse(crooked)).text
    corners = [event.corner for event in events(done, tmp_path) if event.kind == "FEED"]
    assert corners.count("CANON_EXACT_PATH") == 3
    assert len(corners) > 100
    assert set(corners) == {"CANON_EXACT_PATH", "CANON_CONTINUOUS 0.0001"}


def test_moves_that_were_written_one_by_one_stop_one_by_one(linuxcnc):
    path = linuxcnc.read(FIRST + "G61\nG1 X1 F100\nX2\nX3\nM2\n", "x.ngc")
    assert (path.corners_mm[1:] == 0.0).all()
    assert np.isnan(path.corners_mm[0])
