"""Recordings of drives: what is wrong is named with file and line."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.checking import check
from dbbstation.files.recordings.drive_csv import parse_drive, read_drive

HEADER = "t_s,position_mm,force_n"
ROWS = "0.000,1.5,-2\n0.001,1.6,-2.5\n0.002,1.7,3e1\n"


def test_a_recording_with_comments_and_further_columns():
    file = parse_drive(f"# strut 3\n\n{HEADER},temperature\n# cold\n0,1,2,20.1\n0.001,1.5,-3,20.2\n", "x.csv")
    recording = file.recording()
    assert recording.t_s.tolist() == [0.0, 0.001]
    assert recording.position_mm.tolist() == [1.0, 1.5]
    assert recording.force_n.tolist() == [2.0, -3.0]
    assert [str(w) for w in file.warnings] == [
        "x.csv:3: the column `temperature` is not known; it is kept and not used"
    ]


def test_motor_current_needs_the_force_of_an_ampere():
    file = parse_drive("t_s,position_mm,motor_current_a\n0,1,2\n1,2,-3\n", "x.csv")
    assert file.recording(400.0).force_n.tolist() == [800.0, -1200.0]
    with pytest.raises(InputError, match=r"x.csv:1: there is `motor_current_a` and no `force_n`; .*--force-per-ampere"):
        file.recording()


def test_with_both_channels_the_factor_chooses():
    file = parse_drive("t_s,position_mm,force_n,motor_current_a\n0,1,7,2\n1,2,8,3\n", "x.csv")
    assert file.recording().force_n.tolist() == [7.0, 8.0]
    assert file.recording(10.0).force_n.tolist() == [20.0, 30.0]


def test_a_last_line_that_was_cut_off_costs_that_line_alone():
    file = parse_drive(f"{HEADER}\n{ROWS}0.003,1.", "x.csv")
    assert len(file.recording()) == 3
    assert "x.csv:5: the last line was cut off" in str(file.warnings[0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "x.csv: there is no line that names the columns; begin with `t_s,position_mm,force_n`"),
        ("# only\n", "x.csv: there is no line that names the columns"),
        (f"{HEADER}\n", "x.csv:1: there are no rows below this line"),
        ("t_s,pos_mm,force_n\n0,1,2\n", "x.csv:1: there is no column `position_mm`; did you mean `pos_mm`?"),
        ("t_s,position_mm,torque\n0,1,2\n", "x.csv:1: neither `force_n` nor `motor_current_a` is there"),
        ("t_s;position_mm;force_n\n0;1;2\n", "columns are separated by a comma"),
        (f"{HEADER},force_n\n0,1,2,3\n", "x.csv:1: the column `force_n` appears here more than once"),
        (f"{HEADER}\n0,1,2\n0.001,1,5,2\n", "x.csv:3: 4 values in 3 columns"),
        (f"# c\n{HEADER}\n0,1,2\n0.001,nan,2\n", "x.csv:4: position_mm is `nan`, not a finite number"),
        (f"{HEADER}\n0,1,2\n0.001,1,two\n", "x.csv:3: force_n is `two`, not a finite number"),
        (f"{HEADER}\n0,1,2\n0.002,1,2\n0.001,1,2\n", "x.csv:4: time runs backwards here: t_s 0.001 after 0.002"),
        (f"{HEADER}\n0,1,2\n0,1,2\n", "x.csv:3: time stands still here"),
        (f"{HEADER}\n0,1,2\n1,1e9,2\n", "x.csv:3: position_mm is 1e+09, sizes up to 100000 mm are plausible"),
    ],
)
def test_faults_are_named_with_their_line(text, said):
    with pytest.raises(InputError) as caught:
        parse_drive(text, "x.csv")
    assert said in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_drive(tmp_path / "none.csv")


def test_check_knows_a_drive_from_a_run(tmp_path):
    drive = tmp_path / "strut.csv"
    drive.write_text(f"# strut 3\n{HEADER}\n{ROWS}")
    checked = check(drive, {})
    assert (checked.kind, checked.summary, checked.problems) == ("drive", "drive: 3 samples in 0.0 s", [])
    drive.write_text(f"{HEADER}\n0,1,2\n0,1,2\n")
    assert "time stands still" in str(check(drive, {}).problems[0])
    run = tmp_path / "run.csv"
    run.write_text("t_s,length_mm\n0,150\n0.1,150\n")
    assert check(run, {}).kind == "run"


def test_a_long_recording_is_read_whole():
    t = np.arange(50000) / 1000.0
    text = "\n".join([HEADER, *(f"{one:.3f},{np.sin(one):.6f},{-one:.2f}" for one in t)]) + "\n"
    recording = parse_drive(text, "x.csv").recording()
    assert np.array_equal(recording.t_s, np.round(t, 3))
