"""Lines that are read together do the same as lines that are read one by one."""

from __future__ import annotations

import random
from dataclasses import fields

import numpy as np
import pytest

from dbbstation.nc.rs274 import reader
from dbbstation.nc.rs274.lines import plain_lines
from dbbstation.nc.rs274.reader import read_program

AXES = "XYZABC"


def letters_of(text: str) -> np.ndarray:
    return np.frombuffer(text.encode() + b"\0", dtype=np.uint8)


def lines(seed: int) -> str:
    """Mostly lines of axes; modes, stops, arcs and increments between them."""
    draw = random.Random(seed)  # noqa: S311 - the same lines each time, nothing secret
    text = ["G21 G90 G94 G10 L2 P2 X3 Y-4 Z1", "G0 X0 Y0 Z0 A0 B0 C0", "F20 G1 X0.5", "G20"]
    for _ in range(60):
        axes = sorted(draw.sample(AXES, draw.randint(1, 4)), key=AXES.index)
        words = " ".join(f"{axis}{draw.uniform(-9, 9):.{draw.randint(0, 4)}f}" for axis in axes)
        code, feed = draw.choice(["", "", "", "G1 ", "G0", "N7 ", "N8G01 "]), draw.choice(["", "", "", " F90", "F1.5"])
        text.append(code + words + feed + draw.choice(["", "", "", "\r", " "]))
        if draw.random() < 0.1:
            text.append(draw.choice(["G91", "G90", "G20", "G21", "G55", "G4 P1", "M1", "(MSG, x)"]))
    return "\n".join([*text, "M2"]) + "\n"


@pytest.mark.parametrize("seed", range(60))
def test_lines_together_are_as_lines_one_by_one(monkeypatch, seed):
    text, read = lines(seed), []
    for least in (reader.LEAST_LINES, 1_000_000):
        monkeypatch.setattr(reader, "LEAST_LINES", least)
        try:
            read.append(read_program(text, "lines.ngc"))
        except reader.InputError as error:
            read.append(str(error))
    together, singly = read
    if isinstance(singly, str):
        assert together == singly
        return
    for each in fields(singly):
        one, other = getattr(together, each.name), getattr(singly, each.name)
        if each.name == "rows":
            for column in other.dtype.names:
                np.testing.assert_array_equal(one[column], other[column], err_msg=column)
        elif isinstance(other, np.ndarray):
            np.testing.assert_array_equal(one, other, err_msg=each.name)
        else:
            assert one == other, each.name


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("N7 G01 X1.25 Y-.5 F90.", [7, 1, 1.25, -0.5, 90.0]),
        ("X+3.Y1", [-1, np.nan, 3.0, 1.0, np.nan]),
        ("G00X.0000001Y99999999", [-1, 0, 1e-7, 99999999.0, np.nan]),
        ("N12345678X0.1Y0.3", [12345678, np.nan, 0.1, 0.3, np.nan]),
    ],
)
def test_a_plain_line_says_what_python_reads(line, says):
    read = plain_lines(letters_of(f"(Fräser)\n{line}\r\nM2\n"), 10)
    got = [read.numbers[0], read.motion[0], read.axes[0, 0], read.axes[0, 1], read.feed[0]]
    np.testing.assert_array_equal(got, says)
    assert len(read.axes) == 1


OTHER = """N1.5X1 N7.X1 N-7X1 N123456789X1 NX1 G2X1 G0.1X1 G010X1 GX1 G1 F90 G1F90 X X- X1.2.3 X1X2 Y1X2 XY1 X1F-9 X1F123456789
X1234567890123.456 X1#1 X[1] X1(a) X1;a x1 ,X1 /X1 X1Z1.0e5 U1"""


@pytest.mark.parametrize("line", OTHER.split())
def test_every_other_line_is_left_to_the_tokens(line):
    assert len(plain_lines(letters_of(f"{line}\nX1\n"), 0).axes) == 0


def test_a_line_without_its_end_is_left_to_the_tokens():
    for text in ("X1", "G", "N", "X", "G0", "N1", "X1F", "X1\r", ""):
        assert len(plain_lines(letters_of(text), 0).axes) == 0
