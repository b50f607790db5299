"""LinuxCNC's own interpreter reads what is written, and agrees about what hand-written programs command.

Needs `rs274` from the package `linuxcnc-uspace` (Debian, Ubuntu) on the path.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind
from tests.nc.interpreter import calls, events, needs_rs274
from tests.nc.test_fuzz_rs274 import difference
from tests.nc.whole import compensate_toolpath

pytestmark = needs_rs274

BY_HAND = """\
G21 G90 G94 G17 G64 P0.001
G0 X10 Y0 Z-1000 A1 B2 C0
G3 X0 Y10 R10 F600
G2 X10 Y0 R-10
G3 I-10 P2 Z-990
G91 G1 X1 Y-.5 A-1 (one) F 3 00
G4 P.25 G90 g1 x5
G20
F10 G1 X1
G90.1 G3 X-1 I0 J0
G91.1 G2 X1 I1 B5
M0
M2
"""


@pytest.fixture
def canonical(tmp_path):
    """What the interpreter hands to the motion controller: kind and numbers of each call."""

    def run(text: str) -> list[tuple[str, list[float]]]:
        found = calls(text, tmp_path)
        assert found is not None
        return [
            (name, [float(one) for one in printed.split(",") if one.strip()])
            for name, printed in found
            if "UNITS" not in name
        ]

    return run


def moves(calls) -> np.ndarray:
    return np.array([numbers for name, numbers in calls if name.startswith("STRAIGHT")])


@pytest.mark.parametrize("test", ["a", "g", "o"])
def test_it_reads_nominal_and_compensated_circles_as_meant(canonical, linuxcnc, table2, crooked, test):
    path = circle_toolpath(table2.tests[test].circle, "run")
    for written in (path, compensate_toolpath(path, crooked, keep_arcs=True).toolpath):
        calls = canonical(linuxcnc.write(written, ["header (with) brackets", "x" * 400]))
        np.testing.assert_allclose(moves(calls), written.poses[written.is_move], rtol=0.0, atol=0.51e-4)
        assert [numbers for name, numbers in calls if name == "DWELL"] == [[1.0], [0.3], [0.3], [1.0]]
        assert sum(name == "PROGRAM_STOP" for name, _ in calls) == 2
        assert [numbers for name, numbers in calls if name == "SET_FEED_RATE"][1] == [1000.0]


def test_it_agrees_about_programs_written_by_hand(canonical, linuxcnc):
    path = linuxcnc.read(BY_HAND, "hand.ngc")
    lasts = [path.poses[(path.line == line) & path.is_move][-1] for line in np.unique(path.line[path.is_move])]
    told = []
    for name, numbers in canonical(BY_HAND):
        if name == "ARC_FEED":
            x, y, _, _, _, z, a, b, c = numbers
            told.append([x, y, z, a, b, c])
        elif name.startswith("STRAIGHT"):
            told.append(numbers)
    assert len(told) == len(lasts)
    for row, (pose, said) in enumerate(zip(lasts, told, strict=True)):
        unit = 25.4 if row >= 6 else 1.0
        np.testing.assert_allclose(np.array(said) * ([unit] * 3 + [1.0] * 3), pose, atol=0.51e-4 * unit)
    assert path.dwell_s[path.kind == RowKind.DWELL].tolist() == [0.25]


STORED = """\
G21 G90 G17 G54 F200
S100 M3
G0 X0 Y0 Z0
o100 sub
M73
G91 G20 G18
F10
G1 X1
S50
G55
o100 endsub
M70
G91
F50
G1 X5
M5
M72
G1 X20
o100 call
o100 call
G2 X80 I4.6
M72
G1 X4
M71
M2
"""


def test_stored_modes_come_back_as_in_linuxcnc(tmp_path):
    they = events(STORED, tmp_path)
    path = read_program(STORED, "stored.ngc", start=np.zeros(6))
    assert not difference(path, they)
    assert [text for text in path.text.values() if text[0] in "SM"] == [
        "S100 M3",
        "M5",
        "M3",
        "S50",
        "S100",
        "S50",
        "S100",
    ]
