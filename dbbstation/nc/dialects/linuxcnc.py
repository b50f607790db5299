"""LinuxCNC's language: RS274/NGC as its interpreter reads it."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.nc.planner import LookAhead
from dbbstation.nc.rs274.guard import guard_lines, length_lines
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import MESSAGE, Ending
from dbbstation.nc.words import WordDialect

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.setup import ControlSetup
    from dbbstation.nc.spilled import LongText
    from dbbstation.nc.toolpath import Toolpath

MODES = "G21 G90 G94 G17 G40 G49"
"""Millimetres, absolute, feed per minute, arcs in XY, no cutter compensation, no tool length, because the model describes the tool tip. A program must not inherit any of these modes from an earlier program."""


class LinuxCNC(WordDialect):
    """An axis word is written when its value changes, the motion code in every line.

    - F under G94 is the speed along X, Y and Z alone, which is the feed of the tool tip.
    - `G64 P Q0`: P bounds the rounding of corners; exact path (G61) would stop at each of 3600 corners. Q0 keeps
      LinuxCNC from merging short moves, which it does only while A, B and C are constant.
    - G61 and G64 apply to the end of each following move and cause no stop. A G61 move in pieces has G64 before its
      first piece and G61 before its last.
    - Dwells (G4) end blending, so the machine stops at the corner between feed-in and arc.
    """

    name = "linuxcnc"
    extension = ".ngc"
    also_read = ("", ".nc", ".tap", ".cnc", ".gcode", ".gc", ".g", ".eia", ".iso", ".din", ".ncf", ".prg", ".txt")
    what = "LinuxCNC (RS274/NGC)"
    look_ahead = LookAhead(share=0.5)
    takes_setup = takes_text = True
    functions = r"[STEPQ]-?[0-9.]+|G97|M(?:[3-9]|48|49|5[0-3]|6[1-57-8]|1[0-9]{2})"
    systems = r"[\s\S]*"
    instead = MappingProxyType({"(": "[", ")": "]"})
    words = MappingProxyType(
        {
            "begin": MODES,
            "rapid": "G0 {words}",
            "feed": "G1 {words}",
            "in machine": "G53 {move}",
            "exact": "G61",
            "exact stop": "G61.1",
            "continuous": "G64",
            "within": "G64 P{mm} Q0",
            "dwell": "G4 P{seconds}",
            "pause": "M0",
            "pause with text": f"({MESSAGE}{{text}})\nM0",
            "optional stop": "M1",
            "comment": "; {text}",
            "message": "({text})",
            **{ending.value: ending.value for ending in Ending},
        }
    )

    def read(
        self, text: str | LongText, name: str, *, start: Floats | None = None, setup: ControlSetup | None = None
    ) -> Toolpath:
        return read_program(text, name, start=start, setup=setup)

    def before_header(self, toolpath: Toolpath) -> Iterable[str]:
        return ("%",) if toolpath.ending is Ending.TEXT else ()

    def guard(self, holds: Mapping[str, Sequence[float]]) -> Iterable[str]:
        return guard_lines(holds)

    def length_guard(self, text: str, holds: Mapping[str, Sequence[float]], row: int) -> Iterable[str]:
        tool = text.removeprefix("G43 ")
        return length_lines(tool, holds[tool], row) if tool != text and tool in holds else ()
