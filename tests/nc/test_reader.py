"""Programs as people and CAM systems write them, and what is wrong with bad ones."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dbbstation.errors import InputError, StationError
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.toolpath import RowKind

FIRST = "G21 G90 G94\nG0 X0 Y0 Z-1000 A0 B0 C0\n"


def ends(text: str) -> np.ndarray:
    path = read_program(FIRST + text + "\nM2\n", "part.ngc")
    return path.poses[path.is_move][1:]


def test_moves_feeds_and_dwells():
    path = read_program(FIRST + "G1 X10 F600\nY5\nG4 P1.5\nG0 Z-990\nM2\n", "part.ngc")
    assert [RowKind(kind).name for kind in path.kind] == ["RAPID", "FEED", "FEED", "DWELL", "RAPID"]
    np.testing.assert_array_equal(path.poses[2], [10, 5, -1000, 0, 0, 0])
    np.testing.assert_array_equal(path.feed_mm_min[1:3], [600, 600])
    np.testing.assert_allclose(path.duration_s[1:4], [1.0, 0.5, 1.5])
    np.testing.assert_array_equal(path.line, [2, 3, 4, 5, 6])


def test_inches_increments_numbers_lower_case_and_blanks():
    np.testing.assert_allclose(ends("g20\nn10 g91 g1 x1 f 1 0\n")[-1], [25.4, 0, -1000, 0, 0, 0])
    np.testing.assert_allclose(ends("G91 G1 X1 A2 F100\nX1 A2\nG90 Y3\n")[-1], [2, 3, -1000, 4, 0, 0])
    np.testing.assert_allclose(ends("G1X1 2.5Y-.5F100")[-1], [12.5, -0.5, -1000, 0, 0, 0])
    assert read_program(FIRST + "G20\nG1 X1 F10\nM2", "p").feed_mm_min[-1] == 254.0


def test_a_turn_without_a_way_takes_its_feed_in_degrees():
    path = read_program(FIRST + "G1 A3 B4 F60\nX60 A0\nM2\n", "part.ngc")
    np.testing.assert_allclose(path.duration_s[1:], [5.0, 60.0])


def test_polar_coordinates_in_inches():
    turned, longer = ends("G20\nG1 @2 ^30 F10\n^120\nG91 @1\n")[-2:, :2] / 25.4
    np.testing.assert_allclose(ends("G20\nG1 @2 ^30 F10")[-1, :2] / 25.4, [3.0**0.5, 1.0])
    np.testing.assert_allclose([turned, longer / 1.5], [[-1.0, 3.0**0.5]] * 2)


def test_line_numbers_have_eight_digits():
    np.testing.assert_array_equal(ends("N99999999 G0 X1")[-1, 0], 1.0)


@pytest.mark.parametrize("end", ["\r", "\r\n"])
def test_lines_end_as_on_other_systems(end):
    text = FIRST + "G1 X10 F600\nY5 ; up\nX0\nM2\n"
    path = read_program(text.replace("\n", end), "part.ngc")
    np.testing.assert_array_equal(path.poses, read_program(text, "part.ngc").poses)
    np.testing.assert_array_equal(path.line[path.is_move], [2, 3, 4, 5])


def test_a_message_shows_values_of_numbered_and_named_parameters():
    path = read_program(f"{FIRST}#5=1.5\n#<depth>=-2\n(DEBUG, #5 to #<depth>, not #77)\nM2\n", "part.ngc")
    assert path.text == {1: "DEBUG, 1.500000 to -2.000000, not #77"}


def test_the_radius_of_a_tool_set_in_inches_is_kept_in_millimetres():
    assert read_program(f"{FIRST}G20\nG10 L1 P1 R2\nG1 X1 F10\nM2\n", "part.ngc").text[1] == "G10 L1 P1 R50.8"


def test_the_smallest_tilt_under_tool_centre_control_is_refused():
    with pytest.raises(InputError, match=r"part\.ngc:5:4: A or B turns under G43\.4"):
        read_program(f"{FIRST}G10 L1 P1 Z1\nG43.4 H1\nG1 A0.5 F100\nM2\n", "part.ngc")


def test_comments_pauses_functions_and_the_end():
    path = read_program("%\n" + FIRST + "(one) ; two\nS1200 M3\n(MSG, look)\nM0\nM1\nM2\nrubbish\n%\n", "part.ngc")
    assert [path.text.get(row, "") for row in range(1, len(path))] == ["one", "two", "S1200 M3", "look", ""]
    assert [RowKind(kind).name for kind in path.kind[1:]] == [
        "COMMENT",
        "COMMENT",
        "FUNCTION",
        "PAUSE",
        "OPTIONAL_STOP",
    ]
    assert len(read_program("%\n" + FIRST + "%\nG0 X5\n", "part.ngc")) == 1


@pytest.mark.parametrize(
    ("arc", "centre", "swept_deg"),
    [
        ("G3 X0 Y20 I0 J10 F100", (0, 10), 180.0),
        ("G2 X0 Y20 I0 J10 F100", (0, 10), -180.0),
        ("G2 X0 Y0 I5 J0 F100", (5, 0), -360.0),
        ("G3 I5 F100", (5, 0), 360.0),
        ("G3 X10 Y10 R10 F100", (0, 10), 90.0),
        ("G3 X10 Y10 R-10 F100", (10, 0), 270.0),
        ("G2 X10 Y10 R10 F100", (10, 0), -90.0),
        ("G2 X10 Y10 R-10 F100", (0, 10), -270.0),
        ("G90.1\nG3 X10 Y10 I0 J10 F100", (0, 10), 90.0),
        ("G91\nG3 X10 Y10 J10 P2 F100", (0, 10), 450.0),
    ],
)
def test_arcs_lie_on_their_circle_and_turn_the_right_way(arc, centre, swept_deg):
    points = np.vstack([[0.0, 0.0], ends(arc)[:, :2]]) - centre
    radius = np.linalg.norm(points, axis=1)
    np.testing.assert_allclose(radius, radius[0], atol=1e-9)
    angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.degrees(angle[-1] - angle[0]) == pytest.approx(swept_deg)
    assert (np.diff(angle) * np.sign(swept_deg) > 0).all()
    sagitta = radius[0] * (1 - np.cos(np.abs(np.diff(angle)).max() / 2))
    assert sagitta < 0.05e-3


def test_a_helix_moves_the_other_axes_evenly():
    poses = ends("G3 X0 Y0 Z-990 A5 I10 P2 F100")
    np.testing.assert_allclose(np.diff(poses[:, 2]), 10.0 / len(poses), atol=1e-9)
    np.testing.assert_allclose(poses[-1], [0, 0, -990, 5, 0, 0])


@pytest.mark.parametrize(
    ("line", "column", "says"),
    [
        ("G43 H1", 5, "the length of tool 1 is not known"),
        ("G1 X1 F100 M66", 12, "M66 is not read"),
        ("G1 X1 E2 F100", 7, "nothing in this line uses E2"),
        ("G1 X1 X2 F100", 7, "a second X"),
        ("G1 X F100", 4, "the letter X has no number"),
        ("G1 X#5 F100", 5, "#5 is read before the program sets it"),
        ("G1 X[1+] F100", 8, "a number is missing"),
        ("  /G1 X1", 3, "a switch of the control skips"),
        ("G1 X1 (half", 7, "comment"),
        ("G1 X1 F100 ?", 12, "'?'"),
        ("G0 G1 X1", 4, "G1 and G0 exclude each other"),
        ("G1 X5", 4, "G1 without a feed"),
        ("G1 X5 F-3", 7, "negative"),
        ("G4", 1, "seconds"),
        ("G2 X5 F100", 4, "needs I and J, or R"),
        ("G2 X5 I2 R3 F100", 10, "not both"),
        ("G2 X50 R3 F100", 8, "no arc of R3"),
        ("G2 X5 I9 F100", 4, "9.0000 and 4.0000 mm"),
        ("G2 X5 I2.5 P1.5 F100", 12, "number of turns"),
        ("G0 X5 P7", 7, "nothing in this line uses P7"),
        ("G53 G2 X5 R5 F100", 1, "G53 is allowed only with G0 or G1"),
        ("G90.1 G2 X5 I2.5 F10", 10, "both I and J"),
        ("N100000000 G0 X1", 1, "the number after N"),
    ],
)
def test_a_fault_names_line_and_column(line, column, says):
    with pytest.raises(InputError) as caught:
        read_program(FIRST + line + "\nM2\n", "part.ngc")
    (problem,) = caught.value.problems
    assert (problem.file, problem.line, problem.column) == ("part.ngc", 3, column)
    assert says in problem.what
    assert problem.remedy


def test_f_in_the_line_of_g20_counts_in_millimetres_and_in_the_line_of_g21_is_refused():
    """LinuxCNC runs F before G20 and G21 [G-code overview, order of execution]; a slower move is stated, a faster one refused."""
    path = read_program(FIRST + "G20 F10 G1 X1\nF2\nX2\nM2\n", "part.ngc")
    np.testing.assert_allclose(path.feed[path.kind == RowKind.FEED], [10.0, 50.8])
    assert path.notes == (
        "line 3: F10 in the line of G20 counts in millimetres, as in LinuxCNC; inches would be faster",
    )
    with pytest.raises(InputError, match=r"part\.ngc:4:5: F in the line of G21 counts in the units before it"):
        read_program(FIRST + "G20\nG21 F10 G1 X1\nM2\n", "part.ngc")


def test_unreadable_words_are_all_named_at_once():
    with pytest.raises(InputError) as caught:
        read_program("G0 X1 ?\nG33\nG0 X1\nU5\nM2\n", "part.ngc")
    assert [problem.line for problem in caught.value.problems] == [1, 2, 4]


def test_a_program_of_another_language_does_not_flood_the_terminal():
    with pytest.raises(InputError) as caught:
        read_program("L X+1 R0 FMAX\n" * 1000, "part.ngc")
    assert len(caught.value.problems) == 20


def test_the_first_move_must_say_where_the_machine_is():
    with pytest.raises(
        InputError, match=r"part.ngc:2:1: the program does not state the place of A, B, C; --angles-deg"
    ):
        read_program("G0 X1 Y2 Z-1000\nM2\n", "part.ngc")
    with pytest.raises(InputError, match=r"the program does not state the place of X before this move"):
        read_program("G91 G0 X1 Y2 Z-1 A0 B0 C0\nM2\n", "part.ngc")
    start = np.array([0.0, 0.0, -1000.0, 1.0, 2.0, 3.0])
    path = read_program("G91 G0 X1\nM2\n", "part.ngc", start=start)
    np.testing.assert_array_equal(path.poses[0], [1, 0, -1000, 1, 2, 3])
    assert path.tip_mm[0] == 1.0


def test_a_reference_point_that_is_not_declared_stays_with_the_control():
    path = read_program(FIRST + "G91 G28 Z0\nG90 G0 X5\nZ-990\nG28\nM2\n", "part.ngc")
    assert list(path.text.values()) == ["G91 G28 Z0\nG90", "G91 G28 X0 Y0 Z0 A0 B0 C0\nG90"]
    assert path.unknown.tolist() == [0, 0, 0b100, 0, 0]
    declared = np.array([np.nan] * 3 + [0.0] * 3)
    path = read_program("G0 X1 Y2 Z-1000\nG30\nM2\n", "part.ngc", start=declared)
    assert path.text[1] == "G91 G30 X0 Y0 Z0\nG90"


def test_high_speed_modes_are_left_out_and_said():
    path = read_program(FIRST + "G05.1 Q1\nG187 P2\nG50\nG05 P10000\nG0 X1\nM2\n", "part.ngc")
    assert list(path.text.values()) == ["G5.1 Q1 is left out", "G187 P2 is left out", "G5 P10000 is left out"]


def test_a_subprogram_runs_as_often_as_the_digits_before_its_number_say():
    sub = "O1000\nG91 G0 X1\nG90\nM99\n"
    path = read_program(FIRST + "M98 P31000\nM98 P1000 L2\nM30\n" + sub, "part.ngc")
    assert path.poses[:, 0].tolist() == [0, 1, 2, 3, 4, 5]


def test_a_program_without_moves_is_refused(linuxcnc):
    with pytest.raises(InputError, match="moves nothing"):
        linuxcnc.toolpath("G21\nM2\n", "part.ngc")


def test_a_compensated_program_without_its_offsets_is_still_known(linuxcnc, crooked):
    setup = ControlSetup({"G54": (5.0, 0.0, 0.0, 0.0, 0.0, 0.0)})
    path = linuxcnc.toolpath(f"G54\n{FIRST}G1 X5 F100\nM2\n", "part.ngc", setup=setup)
    text = compensated_program(path, linuxcnc, Inverse(crooked)).text
    with pytest.raises(StationError, match="compensated already, says its header"):
        linuxcnc.toolpath(text, "true.ngc")


GRBL = "G21 G90\nM3 S1000\nG1 Z-990 F300\nG0 X0 Y0\nG1 Z-1000\nG1 X50\nG0 Z-990\n"


def test_moves_at_feed_before_the_first_place_and_an_end_by_a_rapid_are_stated(linuxcnc, crooked):
    declared = np.array([np.nan] * 3 + [0.0] * 3)
    path = linuxcnc.toolpath(GRBL, "part.ngc", start=declared)
    assert path.unknown[path.is_move].tolist() == [0b11, 0, 0, 0, 0]
    done = compensated_program(path, linuxcnc, Inverse(crooked))
    assert any("line 3: the program does not state the place of X, Y before this move" in each for each in done.remarks)
    assert any("ends without M2, M30 or %" in each for each in done.remarks)
    first = next(line for line in done.text.splitlines() if line.startswith("G1"))
    assert re.fullmatch(r"G1 Z-\d+\.\d{6}( A\S+ B\S+ C\S+)? F300", first)
    for cut_short in (GRBL.removesuffix("G0 Z-990\n"), GRBL.replace("G0 X0 Y0", "G0 X0")):
        with pytest.raises(InputError):
            linuxcnc.toolpath(cut_short, "part.ngc", start=declared)


def test_a_comment_within_a_comment_is_part_of_it():
    path = read_program(f"{FIRST}(End mill (6 mm) X9)\nG1 X1 F100 (MSG, half (of it))\nM2\n", "part.ngc")
    assert list(path.text.values()) == ["End mill [6 mm] X9", "MSG, half [of it]"]
    assert path.poses[:, 0].max() == 1.0
    for wrong in ("(a (b) X9", "(a) b) X9", "(a (b (c)))"):
        with pytest.raises(InputError):
            read_program(f"{FIRST}{wrong}\nM2\n", "part.ngc")


def test_behind_g80_holds_the_rapid_from_before_the_cycle():
    cycle = "G98 G81 X1 Y1 Z-1005 R-999 F100\nG80\nZ-985\nM2\n"
    path = read_program(FIRST + cycle, "part.ngc")
    assert path.kind[-1] == RowKind.RAPID
    assert path.notes == ("line 5: Z behind G80 is taken for a rapid, as before the cycle",)
    with pytest.raises(InputError, match=r"part\.ngc:6:1: Z without a motion code"):
        read_program(f"{FIRST}G1 X1 F100\n{cycle}", "part.ngc")


def test_a_long_dwell_and_a_dwell_by_x_are_read_in_seconds():
    path = read_program(f"{FIRST}G4 X1.5\nG4 P500\nG1 X1 F10\nM2\n", "part.ngc")
    assert path.dwell_s[path.dwell_s > 0.0].tolist() == [1.5, 500.0]
    assert path.notes == ("line 4 waits 500 s: LinuxCNC counts seconds, some controls milliseconds",)


def test_a_feed_in_the_line_of_its_units_counts_only_if_a_cut_uses_it():
    assert read_program(f"{FIRST}G20 F10\nG1 X1 F2\nM2\n", "part.ngc").feed_mm_min[-1] == pytest.approx(50.8)
    path = read_program(f"{FIRST}G20 F10\nG0 X0\nG1 X1\nM2\n", "part.ngc")
    assert path.feed_mm_min[-1] == 10.0
    assert any("F10 in the line of G20 counts in millimetres" in note for note in path.notes)
