"""Poses as a table: in, compensated, out."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError, StationError
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.registry import dialect_of_file
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind
from dbbstation.nc.words import CannotSayError
from dbbstation.sources.contract import Motion

TABLE = """\
# a part
x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,feed
0,0,-1000,0,0,0,
50,0,-1000,2,0,0,600
50,40,-1001.5,0,1,0,600
50,40,-1001.5,0,3,0,60
0,0,-990,0,0,0,
"""


def test_the_tool_comes_to_each_pose_of_the_table(crooked):
    poses = dialect_of_file("part.csv", TABLE)
    path = poses.toolpath(TABLE, "part.csv")
    assert [RowKind(kind).name for kind in path.kind] == ["COMMENT", "RAPID", "FEED", "FEED", "FEED", "RAPID"]
    np.testing.assert_array_equal(path.feed[2:5], [600.0, 600.0, 60.0])
    text = compensated_program(path, poses, Inverse(crooked)).text
    done = poses.toolpath(text, "true.csv")
    tool = crooked.actual_poses(Motion(poses=done.poses[done.is_move], is_path=True))
    for wanted in path.poses[path.is_move]:
        assert np.abs(tool - wanted).max(axis=1).min() < 3e-6
    with pytest.raises(StationError, match="compensated already"):
        compensated_program(done, poses, Inverse(crooked))


def test_a_table_that_is_none_is_refused_with_its_line():
    poses = dialect_of_file("part.csv", TABLE)
    with pytest.raises(InputError, match=r"part\.csv:2:1: the columns are others"):
        poses.toolpath(TABLE.replace("x_mm", "x"), "part.csv")
    with pytest.raises(InputError, match=r"part\.csv:4:1: no pose and feed"):
        poses.toolpath(TABLE.replace("50,0,", "50,zero,"), "part.csv")
    with pytest.raises(InputError, match=r"part\.csv:3:1: no pose and feed"):
        poses.toolpath(TABLE.replace("-1000,0,0,0,\n", "-1000,0,0,0\n", 1), "part.csv")


def test_what_is_no_move_is_refused_by_name():
    poses = dialect_of_file("part.csv", TABLE)
    path = read_program("G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\nS800 M3\nG1 X1 F100\nM2\n", "part.ngc")
    with pytest.raises(CannotSayError, match=r"part\.ngc:3: the dialect poses has no words for function S800 M3"):
        poses.write(path)
