"""LinuxCNC: RS274/NGC as its interpreter reads it."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from dbbstation.nc.dialect import plain
from dbbstation.nc.planner import LookAhead
from dbbstation.nc.rs274.guard import guard_lines, length_lines
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import MESSAGE, Ending
from dbbstation.nc.words import WordDialect, digits

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.nc.setup import ControlSetup
    from dbbstation.nc.toolpath import Toolpath

MODES = "G21 G90 G94 G17 G40 G49"
"""Millimetres, absolute, feed per minute, arcs in XY, no cutter compensation, no tool length: the model is about the
tool tip. A program must not inherit any of these from the one before it."""


_FUNCTION = re.compile(r"[STQ][0-9.]+|G97|M(?:[3-9]|48|49|61)")
"""Words of spindle, coolant, tool changes, override switches."""


class LinuxCNC(WordDialect):
    """Words of an axis are written where they change, the motion code in every line.

    - F under G94 is the speed along X, Y and Z as if A, B and C stood still, which is the feed of the tool tip: it
      needs no correction where the platform tilts on the way.
    - `G64 P Q0`: LinuxCNC starts with corners rounded as far as the feed needs. P bounds that. Exact path (G61) would
      stop at each of 3600 corners. Q0 keeps LinuxCNC from merging short moves, which it does only while A, B and C
      stand still: nominal and compensated programs would run differently.
    - G61 and G64 hold for the end of each move that follows, and do not stop the machine themselves: a move under G61
      that is written in pieces has G64 before the first and G61 before the last.
    - Dwells (G4) end blending: between feed-in and arc the machine stands still at the corner.
    """

    name = "linuxcnc"
    extension = ".ngc"
    also_read = (".nc", ".tap", ".cnc", ".gcode", ".gc", ".eia")
    what = "LinuxCNC (RS274/NGC)"
    look_ahead = LookAhead(share=0.5)
    takes_setup = True

    def read(
        self, text: str, name: str, *, start: NDArray[np.float64] | None = None, setup: ControlSetup | None = None
    ) -> Toolpath:
        """Return what a program commands."""
        return read_program(text, name, start=start, setup=setup)

    def before_header(self, toolpath: Toolpath) -> Iterable[str]:
        """Return the percent sign, if the program ends with one."""
        return ("%",) if toolpath.ending is Ending.TEXT else ()

    def begin(self, toolpath: Toolpath) -> Iterable[str]:  # noqa: ARG002
        """Return the modes."""
        return (MODES,)

    def end(self, toolpath: Toolpath) -> Iterable[str]:
        """Return M2, M30 or the percent sign."""
        return (toolpath.ending.value,)

    def rapid(self, words: str) -> str:
        """Return G0."""
        return f"G0 {words}".rstrip()

    def feed(self, words: str, feed: float | None) -> str:
        """Return G1, F where it changes."""
        return f"G1 {words}" if feed is None else f"G1 {words} F{digits(feed)}"

    def in_machine(self, move: str) -> str:
        """Return the move with G53, which holds for its line."""
        return f"G53 {move}"

    def corner(self, corner_mm: float) -> str:
        """Return G61, G61.1, G64, or G64 with P and Q0."""
        if corner_mm <= 0.0:
            return "G61" if corner_mm == 0.0 else "G61.1"
        return "G64" if math.isinf(corner_mm) else f"G64 P{digits(corner_mm)} Q0"

    def dwell(self, seconds: float) -> str:
        """Return G4."""
        return f"G4 P{digits(seconds)}"

    def pause(self, text: str) -> str:
        """Return M0 behind its message."""
        return f"({message_before_stop(text)})\nM0" if text else "M0"

    def optional_stop(self) -> str:
        """Return M1."""
        return "M1"

    def comment(self, text: str) -> str:
        """Return a comment behind a semicolon, which LinuxCNC ignores."""
        return f"; {plain(text)}".rstrip()

    def message(self, text: str) -> str:
        """Return a comment that LinuxCNC acts on."""
        return f"({text})"

    def function(self, words: str) -> str:
        """Return the words of spindle, coolant and tool changes."""
        if not all(_FUNCTION.fullmatch(word) for word in words.split()):
            raise self.cannot_say(words)
        return words

    def system(self, text: str) -> str:
        """Return the words."""
        return text

    def guard(self, holds: Mapping[str, Sequence[float]]) -> Iterable[str]:
        """Return conditions of O-words on LinuxCNC's parameters."""
        return guard_lines(holds)

    def length_guard(self, text: str, holds: Mapping[str, Sequence[float]], row: int) -> Iterable[str]:
        """Return the same behind G43."""
        tool = text.removeprefix("G43 ")
        return length_lines(tool, holds[tool], row) if tool != text and tool in holds else ()


def message_before_stop(text: str) -> str:
    """Return a pause's text as a message: one line, square brackets."""
    return f"{MESSAGE}{plain(text).replace('(', '[').replace(')', ']')}"
