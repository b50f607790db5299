"""Programs as other people and their CAM write them: read as LinuxCNC reads them, compensated onto their path, or refused by line.

`DBBSTATION_LOOK_ALIKES=2000` reads as many. What LinuxCNC's planner makes of them: `test_look_alikes_on_the_planner.py`.
"""

from __future__ import annotations

import os
import re

import numpy as np
import pytest

from dbbstation.errors import InputError, StationError
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274 import flow
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.toolpath import RowKind, Toolpath
from dbbstation.sources.contract import Motion
from tests.nc.interpreter import events, needs_rs274
from tests.nc.look_alikes import STYLES, look_alike
from tests.nc.test_fuzz_rs274 import difference

COUNT = int(os.environ.get("DBBSTATION_LOOK_ALIKES", "64"))


@needs_rs274
def test_they_are_read_as_linuxcnc_reads_them(tmp_path):
    for seed in range(COUNT):
        text = look_alike(seed)
        they = events(text, tmp_path)
        assert they is not None, f"seed {seed}: LinuxCNC refuses\n{text}"
        differs = difference(read_program(text, "drawn.ngc"), they)
        assert not differs, f"seed {seed}: {differs}\n{text}"


def to_the_path_mm(points: np.ndarray, path: Toolpath) -> float:
    """Greatest distance of points, shape (k, 3), from the lines and arcs at feed of a program, whose chords are 0.05 µm off [mm]."""
    at_feed = path.kind == RowKind.FEED
    begin, end = path.before[at_feed, :3], path.poses[at_feed, :3]
    way = end - begin
    length2 = np.maximum(np.einsum("mi,mi->m", way, way), 1e-30)
    middle = begin.mean(axis=0)  # products of small numbers: a distance is right to 5 nm
    begin, worst2 = begin - middle, 0.0
    for some in np.array_split(points - middle, 1 + len(points) * len(way) // 1_000_000):
        along, square = some @ way.T - np.einsum("mi,mi->m", begin, way), np.einsum("ki,ki->k", some, some)[:, None]
        square = square - 2.0 * some @ begin.T + np.einsum("mi,mi->m", begin, begin)
        share = np.clip(along / length2, 0.0, 1.0)
        worst2 = max(worst2, float((square - share * (2.0 * along - share * length2)).min(axis=1).max()))
    return worst2**0.5


@pytest.mark.parametrize("style", range(len(STYLES)), ids=[style.__name__ for style in STYLES])
def test_the_tool_goes_along_their_path(style, linuxcnc, crooked):
    """At 1 m/s² with the chord preferred: an arc beside long lines was said to be 19 mm off, and refused."""
    model = MachineModel(crooked.machine, crooked.sources)
    seed = style + len(STYLES)
    path = read_program(look_alike(seed), "drawn.ngc")
    written = compensated_program(path, linuxcnc, Inverse(model), chord_mm=1e-3)
    assert written.chord_error_um <= 1.0
    done = read_program(written.text, "written.ngc")
    row, share = done.subdivided(2.0, 2.0)
    commanded = done.between(row, share)[(done.kind[row] == RowKind.FEED)]
    tool = model.actual_poses(Motion(poses=commanded, is_path=True))
    assert to_the_path_mm(tool[:, :3], path) < 1e-3 + 1e-4


# What posts for other controls, and for other machines, write.

HEAD = "G21 G90 G94\nG0 X0 Y0 Z-1000 A0 B0 C0\nF500\n"

READ = {
    "a tool length": "T1 M6\nG43 H1\nG0 Z-990\n",
    "an offset table": "G10 L2 P1 X5\nG1 X10\n",
    "touching off": "G10 L20 P0 X0 Y0\nG1 X10\n",
    "a shifted zero": "G1 X10\nG92 X0\nG1 X5\n",
    "a local shift": "G52 X5\nG1 X10\n",
    "drilling": "G98 G81 X5 Y5 Z-1005 R-998\nX10\nG80\n",
    "peck drilling": "G98 G83 X5 Y5 Z-1010 R-998 Q2\nG80\n",
    "chip breaking": "G73 X5 Y5 Z-1010 R-998 Q2\nG80\n",
    "boring": "G85 X5 Y5 Z-1010 R-998\nG80\n",
    "the other planes": "G18\nG2 X10 Z-1000 I5 K0\n",
    "an arc with K": "G2 X10 Y0 I5 J0 K0\n",
    "home": "G91 G28 Z0\nG90\n",
    "a subroutine": "O100 sub\nG1 X10\nO100 endsub\nO100 call\n",
    "a condition": "O1 if [1 GT 0]\nG1 X10\nO1 endif\n",
    "a loop": "O1 repeat [3]\nG91 G1 X1\nO1 endrepeat\n",
    "a parameter": "#1 = 5\nG1 X#1\n",
    "an expression": "G1 X[2 * 5]\n",
    "a tool change": "M6 T2\nG1 X10\n",
    "overrides": "M48\nG1 X10\n",
    "exact path without stops": "G61.1\nG1 X10\n",
    "inverse time": "G93\nG1 X10 F2\nG2 X12 I1 F3\nG1 A2 F4\nG94 F50\nG1 X1\n",
    "the third plane": "G19\nG3 Y10 Z-1000 J5 K0 X3\nG17\n",
    "radius in another plane": "G18\nG2 X7 Z-993 R7\nG19 G3 Y3 Z-990 R-4\nG17\n",
    "cycles one after another": "G98 G81 X5 Y5 Z-1005 R-998\nX7\nG99 G82 X9 Z-1002 R-999 P0.5\nG83 X11 Z-1007 R-999 Q3\nG80\nG0 Z-990\n",
    "cycles from below": "G99 G81 X5 Z-1005 R-990\nX7\nG80\n",
    "cycles by increments": "G99 G91 G81 X3 Y1 Z-4 R-1 L3\nG90 G80\n",
    "boring with a stop": "S100 M3\nG86 X5 Z-1005 R-998 P0.5\nG89 X7 Z-1005 R-998 P1\nG80\n",
    "subroutines with values": "O<hole> sub\nG1 X#1 Y#2\n#<deep>=[#3-1]\nG1 Z#<deep>\nO<hole> endsub [#1*2]\n"
    "O<hole> call [1] [2] [-1000]\nO<hole> call [#<_value>] [5] [-999]\n",
    "loops": "#5=0\nO1 while [#5 LT 3]\n#5=[#5+1]\nO2 if [#5 EQ 2]\nO1 continue\nO2 elseif [#5 EQ 9]\nG1 X99\nO2 else\nG1 X#5\nO2 endif\nO1 endwhile\n"
    "O3 do\n#5=[#5-1]\nG1 Y#5\nO4 if [#5 LE -2]\nO3 break\nO4 endif\nO3 while [1 EQ 1]\nO5 repeat [2]\nG91 G1 X1\nO5 endrepeat\nG90\n",
    "functions": "G1 X[ATAN[1]/[2]] Y[2 ** 3 MOD 5] Z[-1000 - ABS[ROUND[-2.5]]]\nG1 X[SQRT[16] + FIX[-1.5] * FUP[1.2]]\n"
    "G1 Y-[COS[60]] A[1 AND 0] B[2 GE 2 XOR 0] C[ASIN[0.5] / 10]\n",
    "a position": "G55 G0 X3 Y4\nG1 X[#5420 + 1] Y[#<_y> * 2]\n",
}
"""Each was refused once; all are read as LinuxCNC reads them."""

SETUP = ControlSetup({"G28": (1.0, 2.0, -950.0, 0.0, 0.0, 0.0)}, {1: (0.0, 0.0, 2.54, 0.0, 0.0, 0.0)})
STORED = {5161: 1.0 / 25.4, 5162: 2.0 / 25.4, 5163: -950.0 / 25.4}
TOOLS = "T1 P1 Z0.1\nT2 P2 Z0\n"


@needs_rs274
@pytest.mark.parametrize("what", READ)
def test_what_is_read_is_read_as_linuxcnc_reads_it(what, tmp_path):
    text = f"{HEAD}{READ[what]}G1 X20\nM2\n"
    they = events(text, tmp_path, STORED, TOOLS)
    path = read_program(text, "other.ngc", setup=SETUP)
    assert path.is_move.sum() > 2
    if they is None:
        assert what == "an arc with K"  # as FreeCAD writes it: K0 in an arc in X and Y
        return
    assert not difference(path, they)


FOREIGN = {
    "a dynamic tool length": ("G43.1 Z10\n", 4, "G43.1"),
    "tool centre point control": ("G0 A1\nG43.4 H1\n", 5, "G43.4 while A or B"),
    "an unknown diameter": ("G41 D1\nG1 X10\nG40\n", 4, "the diameter of tool 1 is not known"),
    "tapping": ("G84 X5 Y5 Z-1010 R-998\nG80\n", 4, "G84"),
    "rigid tapping": ("S200 M3\nG33.1 Z-1010 K1\n", 5, "G33.1"),
    "threading": ("S200 M3\nG33 Z-1010 K1\n", 5, "G33"),
    "probing": ("G38.2 Z-1010\nG0 Z-990\n", 4, "G38.2"),
    "probing away": ("G38.5 Z-990\n", 4, "G38.5"),
    "a NURBS": ("G5.2 P1 L3\nX5 Y5 P1\nX10 Y0 P1\nG5.3\n", 4, "G5.2"),
    "inverse time to the next line": ("G93\nG1 X10 F2\nX12\nG94\n", 6, "without a feed"),
    "feed per turn": ("S100 M3\nG95\nG1 X10 F0.1\n", 5, "G95"),
    "cutting speed": ("G96 D2000 S100\n", 4, "G96"),
    "Fanuc's subroutine": ("M98 P100\n", 4, "M98"),
    "a named parameter": ("G1 X#<wide>\n", 4, "#"),
    "a skipped line": ("/G1 X10\n", 4, "/"),
    "polar coordinates beside X": ("G1 X1 @10 ^45\n", 4, "@"),
    "pallets": ("M60\n", 4, "M60"),
    "waiting for an input": ("M66 P0 L3 Q5\n", 4, "M66"),
    "an external subprogram": ("M198 P1000\n", 4, "M198"),
    "a loop of macros without its end": ("#1=0\nWHILE [#1 LT 3] DO1\n#1=#1+3\nGOTO 7\n", 7, "N7"),
    "a tap while the spindle stands": ("G98 G84 X1 Z-1001 R-999 F100\n", 4, "G84 while the spindle"),
    "a code of another control": ("M31\n", 4, "M31"),
    "a state that is not stored": ("M71\n", 4, "M71 without modes that were stored"),
    "a stored state without its system": ("M70\nG55\nM72\n", 6, "a work system that no line names"),
    "a turned spindle": ("M19 R90\n", 4, "M19"),
    "a second spindle": ("S100 $1\n", 4, "$"),
    "diameters": ("G7\n", 4, "G7"),
    "other axes": ("G1 U1\n", 4, "U"),
    "an extruder": ("G1 X1 E0.5\n", 4, "E"),
    "a subprogram without its call": ("O1234 (PART)\n", 4, "O1234"),
    "a high-speed mode with axes": ("G8 X10\n", 4, "G8 with axes"),
    "scaling": ("G51 X0 Y0 P2\n", 4, "G51"),
    "turned coordinates": ("G68 X0 Y0 R30\n", 4, "G68"),
    "more work systems": ("G54.1 P3\n", 4, "G54.1"),
    "a decimal comma": ("G1 X1,5\n", 4, ","),
    "an exponent": ("G1 X1E1\n", 4, "E"),
    "an assignment": ("G1 X=10\n", 4, "X"),
    "a cycle without G98 or G99": ("G0 Z-990\nG81 X5 Z-1005 R-998\n", 5, "neither G98 nor G99"),
    "an endless loop": ("O1 while [1 GT 0]\nO1 endwhile\n", 5, "may never end"),
    "a subprogram of another file": ("O<away> call\n", 4, "not in this file"),
    "a main program that repeats": ("M99\n", 4, "endlessly"),
    "H without its length": ("G43 H7\n", 4, "the length of tool 7 is not known"),
    "H that is no tool": ("G43 H0\n", 4, "H0 is no tool"),
    "a cut from a reference point": ("G30 Z0\n", 5, "does not state the place of Z"),
    "G92 before anything is known": ("G92.1\nG91 G38 Z1\n", 5, "G38 is not read"),
    "a rotation": ("G10 L2 P1 R30\n", 4, "rotation"),
    "the tool table by a fixture": ("G10 L10 P1 Z20\n", 4, "G10 L10 is not read"),
    "the tool table without a tool": ("G10 L1 Z20\n", 4, "G10 L1 without the number of a tool"),
    "an offset by its parameter": ("#5221 = 5\n", 4, "#5221 is the control's own"),
    "what the control knows": ("G1 X#31\n", 4, "#31 is read before"),
    "no number": ("G1 X[1/0]\n", 4, "has no value"),
    "a cycle that goes up": ("G81 X5 Z-990 R-998\n", 4, "goes down"),
    "a cycle without R": ("G81 X5 Z-1005\n", 4, "needs R"),
    "a condition without brackets' end": ("O1 if [1 GT 0\nO1 endif\n", 4, "is missing"),
    "a Heidenhain line": ("L X+10 R0 FMAX\n", 4, "L"),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_what_is_not_read_is_refused_with_its_line(what, monkeypatch):
    monkeypatch.setattr(flow, "MOST_AGAIN", 5_000)  # the whole limit takes ten seconds
    body, line, named = FOREIGN[what]
    with pytest.raises(InputError, match=rf"other\.ngc:{line}:\d+: .*{re.escape(named)}"):
        read_program(f"{HEAD}{body}G1 X20\nM2\n", "other.ngc")


def test_a_foreign_program_is_refused_as_a_whole(linuxcnc, crooked):
    body = "".join(body for body, *_ in FOREIGN.values())
    with pytest.raises(StationError) as refused:
        compensated_program(linuxcnc.read(f"{HEAD}{body}M2\n", "all.ngc"), linuxcnc, Inverse(crooked))
    assert len(str(refused.value).splitlines()) >= 20
