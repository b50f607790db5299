"""Lines that are read together do the same as lines that are read one by one."""

from __future__ import annotations

import random
import re
from dataclasses import fields

import numpy as np
import pytest

from dbbstation.nc.rs274 import reader
from dbbstation.nc.rs274.reader import read_program

AXES = "XYZABC"


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
    for pattern in (reader.LINES, re.compile("(?!)")):
        monkeypatch.setattr(reader, "LINES", pattern)
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
        if isinstance(other, np.ndarray):
            np.testing.assert_array_equal(one, other, err_msg=each.name)
        else:
            assert one == other, each.name
