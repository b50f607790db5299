"""Fanuc's macros as the O-words that they mean, and tapping cycles as LinuxCNC runs them."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.rs274 import flow
from dbbstation.nc.rs274.reader import read_program
from tests.nc.interpreter import events, needs_rs274, printed
from tests.nc.test_fuzz_rs274 import difference

HEAD = "G21 G90 G17 G98\nG0 X0 Y0 Z-990 A0 B0 C0\n"

FANUC = f"""%
O0001 (STEPS)
{HEAD}#1 = 1. (FROM)
#3=.3
#4=0
WHILE [ #1 GT 0 ] DO1 (DEEPER)
#1= #1 - #3
IF [#1 LT 0] THEN #1= 0
G01 Z[#1 - 1000] F100
WHILE[#4 LT 2]DO2
G1 X#4
#4=#4+1
END2
#4=0
END1
IF [#1 EQ 0] GOTO 20
G0 X99
N20 G0 Z-990
GOTO 30
G0 X98
N30 M30
%
"""

O_WORDS = f"""{HEAD}#1=1
#3=.3
#4=0
o1 while [#1 GT 0]
#1=[#1-#3]
o2 if [#1 LT 0]
#1=0
o2 endif
G1 Z[#1 - 1000] F100
o3 while [#4 LT 2]
G1 X#4
#4=[#4+1]
o3 endwhile
#4=0
o1 endwhile
G0 Z-990
M2
"""


@needs_rs274
def test_macros_run_as_the_same_program_in_o_words(tmp_path):
    path = read_program(FANUC, "o0001.nc", start=np.zeros(6))
    they = events(O_WORDS, tmp_path)
    assert len(path) > 10
    assert not difference(path, they)


def test_a_macro_that_never_ends_is_refused(monkeypatch):
    """Soon: as late as the program allows, O-words are in `test_look_alikes.py`."""
    monkeypatch.setattr(flow, "MOST_AGAIN", 1000)
    with pytest.raises(InputError, match="may never end"):
        read_program(f"{HEAD}N1 GOTO 1\nM2\n", "part.nc")
    with pytest.raises(InputError, match=r"part\.nc:4:1: END of loop 2 has no WHILE"):
        read_program(f"{HEAD}#1=0\nEND2\nM2\n", "part.nc")


TAPS = """T1 M6
S500 M3
F300 G84 X1 Y2 Z-1005 R-998 P0.5
G99 X3 R-999
G80
M4
G74 X1 Y2 Z-1005 R-998
G80
G20
G0 X0 Y0
G2 X0.4 Y0 I0.2014 J0 F10
M2
"""


@needs_rs274
def test_taps_turn_the_spindle_back_at_the_bottom_with_fixed_overrides(linuxcnc, tmp_path):
    """And an arc in inches may be off its circle by 0.072 mm."""
    path = linuxcnc.toolpath(HEAD + TAPS, "taps.ngc", start=np.zeros(6))
    assert not difference(path, events(HEAD + TAPS, tmp_path))
    assert any("floating chuck" in note for note in path.notes)

    def spindle(text: str) -> list[str]:
        kept = ("SPINDLE", "OVERRIDE", "DWELL", "STRAIGHT_FEED")
        told = (
            f"{call}({arguments})" for call, arguments in printed(text, tmp_path) if any(one in call for one in kept)
        )
        return [each for each in told if "FEED(" not in each or ", 2.0000, -" in each]

    assert len(spindle(HEAD + TAPS)) > 25
    assert spindle(linuxcnc.write(path)) == spindle(HEAD + TAPS)


def test_goto_stays_within_its_program():
    """Each program numbers its lines anew."""
    sub = "O2000\nN10 G91 G0 X1\nG90\nM99\n"
    main = f"O1000\n{HEAD}#1=0\nN10 #1=#1+1\nG0 Y#1\nIF[#1 LT 3]GOTO10\nM98 P2000\nM30\n"
    path = read_program(f"%\n{main}{sub}%\n", "o1000.nc")
    assert path.poses[:, 1].tolist() == [0, 1, 2, 3, 3]
    assert path.poses[:, 0].tolist() == [0, 0, 0, 0, 1]
