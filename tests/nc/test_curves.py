"""Curves by control points (G5, G5.1), beside LinuxCNC's own preview of them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Motion
from tests.nc.interpreter import needs_rs274, printed
from tests.nc.test_look_alikes import to_the_path_mm

pytestmark = needs_rs274

PREVIEW = Path(__file__).with_name("preview.py")
CHORDS_MM = 5.1e-5
"""What chords of a curve may leave it by, and the rounding of the distance."""

HEAD = "G21 G90 G94 G17\nG0 X1 Y2 Z-1000 A0 B0 C0\nF300\n"
CURVES = """\
G5.1 X10 Y5 I4 J8
G1 X11
G5.1 X20 I3 J-2
G91 G5 X10 Y-5 I2 J2 P-1 Q-3
G90 G20 G5.1 X0.5 Y0.5 I0 J-1
M2
"""


def previewed(file: Path) -> np.ndarray:
    """Return the points of moves at feed in LinuxCNC's preview, shape (k, 3) [mm]; all lie on the curves."""
    command = ["/usr/bin/python3", str(PREVIEW), str(file)]
    return np.array(json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout))


def test_their_points_are_linuxcncs(tmp_path):
    (tmp_path / "curves.ngc").write_text(HEAD + CURVES)
    theirs = previewed(tmp_path / "curves.ngc")
    theirs[:, 2] = -1000.0  # in inches the preview multiplies Z of curves by 25.4 twice
    path = read_program(HEAD + CURVES, "curves.ngc")
    assert len(theirs) > 100
    assert to_the_path_mm(theirs, path) < CHORDS_MM
    ends = path.poses[np.append(path.line[1:] != path.line[:-1], True) & (path.kind == RowKind.FEED), :3]
    for end in ends:
        assert np.linalg.norm(theirs - end, axis=1).min() < 1e-9


def test_a_parabola_is_cut_into_chords_of_the_parabola():
    path = read_program(f"{HEAD}G0 X0 Y0\nG93 G5.1 X10 Y0 I5 J5 F2\nM2\n", "parabola.ngc")
    cut = path.kind == RowKind.FEED
    x, y = path.poses[cut, :2].T
    np.testing.assert_allclose(y, x * (10.0 - x) / 10.0, atol=1e-12)
    # Its length is 5 (sqrt 2 + arsinh 1), in half a minute.
    assert path.feed[cut][0] == pytest.approx(10.0 * (2.0**0.5 + np.arcsinh(1.0)), rel=3e-6)


REFUSED = [
    "G5.1 X5",
    "G5.1 X5 J1",
    "G5.1 I3 J3",
    "G5.1 X5 Z1 I1",
    "G18 G5.1 X5 I1",
    "G5 X5 I1 J1",
    "G5 X5 I1 J1 P1 Q1 A1",
]
REFUSED += ["G1 G5.1 X5 I1", "G53 G5.1 X5 I1", "G5.1 X5 I1 K1", "G5.1 X5 I1\nX6", "G41.1 D1\nG5.1 X5 I1\nG40"]


@pytest.mark.parametrize("body", REFUSED)
def test_what_linuxcnc_refuses_is_refused(body, tmp_path):
    text = f"{HEAD}{body}\nM2\n"
    assert printed(text, tmp_path) is None
    with pytest.raises(InputError, match=r"c\.ngc:[4-6]:\d"):
        read_program(text, "c.ngc")


def test_the_tool_follows_the_curve(linuxcnc, crooked):
    path = read_program(HEAD + CURVES, "curves.ngc")
    written = compensated_program(path, linuxcnc, Inverse(crooked), chord_mm=1e-3)
    done = linuxcnc.read(written.text, "written.ngc")
    row, share = done.subdivided(0.1, 1.0)
    commanded = done.between(row, share)[done.kind[row] == RowKind.FEED]
    tool = crooked.actual_poses(Motion(poses=commanded, is_path=True))
    assert to_the_path_mm(tool[:, :3], path) < 1e-3 + 1e-4
