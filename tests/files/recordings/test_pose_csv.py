"""Tables of poses: what a spreadsheet makes of them is refused with its line, never read as something else."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.provenance import Provenance
from dbbstation.files.recordings.pose_csv import read_poses, write_poses

HEADER = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg"


def read(tmp_path: Path, text: str):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    return read_poses(path)


def test_poses_and_further_columns(tmp_path: Path) -> None:
    table = read(tmp_path, f"name,{HEADER}\np1,1,2,-1000,0.5,0,0\np2,1,2,-1001,0,0,1e-1\n")
    assert table.poses.tolist() == [[1, 2, -1000, 0.5, 0, 0], [1, 2, -1001, 0, 0, 0.1]]
    assert table.others == {"name": ("p1", "p2")}
    u_mm = np.array([[0.001, 0.002, np.nan], [0.001, 0.002, 0.003]])
    write_poses(
        tmp_path / "out.csv", table.poses, u_mm, table.others, Provenance("p 1", "p", {}), why_unknown="no, not Z"
    )
    with (tmp_path / "out.csv").open(newline="") as file:
        first, second, third = csv.reader(file)
    assert ",".join(first) == f"{HEADER},u_x_mm,u_y_mm,u_z_mm,u_not_known_because,name"
    assert second[6:] == ["0.0010000", "0.0020000", "", "no, not Z", "p1"]
    assert third[6:] == ["0.0010000", "0.0020000", "0.0030000", "", "p2"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{HEADER}\n1,5,2,-1000,0,0,0\n", ":2: 7 values in 6 columns; compare the line with the header; the decimal sign"),
        (f"{HEADER}\n1,2,-1000,0,0\n", ":2: 5 values in 6 columns"),
        (f'{HEADER}\n"1,5",2,-1000,0,0,0\n', ":2: x_mm is `1,5`, not a finite number; correct or remove the line; the decimal sign is a dot, columns are separated by a comma: other tables need --decimal"),
        (f"{HEADER}\n1,2,-1000,0,0,nan\n", ":2: c_deg is `nan`, not a finite number; correct or remove the line"),
        (f"{HEADER}\n1,,-1000,0,0,0\n", ":2: y_mm is ``, not a finite number"),
        (f"{HEADER.replace(',', ';')}\n1,5;2;-1000;0;0;0\n", ":1: there is no column `c_deg`; the decimal sign is a dot, columns are separated by a comma"),
        ("x_mm,y_mm\n1,2\n", ":1: there is no column `a_deg`; columns here: x_mm, y_mm"),
        (f"{HEADER}\n", ":1: there are no rows below this line"),
        ("", "the file has no columns and no rows"),
    ],
)  # fmt: skip
def test_faults_are_named_with_their_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert said in str(caught.value)
