"""LinuxCNC's language: RS274/NGC as its interpreter reads it.

O-words guard a program: they stop it unless LinuxCNC's offsets are as assumed. Parameters [LinuxCNC, G-code overview,
Numbered Parameters]: #5220 is the number n of the active work system, 1 to 9; #5201 + 20 n and the next eight are its
offsets in X to W, #5210 + 20 n its rotation about Z; #5211 to #5219 are G92, #5401 to #5409 the active tool length,
#<_tool_offset> is 1 if there is one. All are in the machine's units.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.nc.planner import LookAhead
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.rs274.state import LENGTH, SYSTEM
from dbbstation.nc.setup import FIRST_PARAMETERS, PER_SYSTEM, ZERO, offset_text
from dbbstation.nc.toolpath import IN_FORCE, MESSAGE, SYSTEMS, Ending
from dbbstation.nc.words import WordDialect

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.setup import ControlSetup
    from dbbstation.nc.spilled import LongText
    from dbbstation.nc.toolpath import Toolpath


FIRST_LABEL, FIRST_LENGTH_LABEL = 100, 1000

WITHIN = 5e-4
"""Largest sum of all differences between actual and declared offsets [mm, deg]."""

_IN_FORCE = FIRST_PARAMETERS[SYSTEMS[0]] - PER_SYSTEM
"""Parameter of X in work system 0; each work system adds 20."""

_AXES = 9
_TERMS = 5
"""Number of terms in one line, since the length of LinuxCNC's lines is limited."""

_WORK = "work system {} is not {}: this program is right for that only. Set it, or compensate anew"
_OTHER = "G92 is not {}. Clear it with G92.1, or compensate anew"
_TOOL = "a tool length is in force: this program has none. Cancel it with G49, then start again"
_LENGTHS = "the length of tool {} is not {}. Compensate anew with it"


def guard_lines(holds: Mapping[str, Sequence[float]]) -> list[str]:
    """Return a guard for offsets by `IN_FORCE`, `G54` and so on, and `G92`; lengths such as `H1` are checked later."""
    checks = []
    for name in (IN_FORCE, *SYSTEMS):
        if name in holds:
            number = f"[{{}}+{PER_SYSTEM}*#{SYSTEM}]" if name == IN_FORCE else "{}"
            first = FIRST_PARAMETERS.get(name, _IN_FORCE)
            parameters = [f"#{number.format(first + k)}" for k in range(_AXES + 1)]
            checks.append((parameters, holds[name], _WORK.format(name, offset_text(holds[name]))))
    g92 = holds.get("G92", ZERO)
    parameters = [f"#{FIRST_PARAMETERS['G92'] + k}" for k in range(_AXES)]
    checks.append((parameters, g92, _OTHER.format(offset_text(g92))))
    if not any(name.startswith("H") for name in holds):
        checks.append((["#<_tool_offset>"], (), _TOOL))
    return list(_stops(checks, FIRST_LABEL))


def length_lines(tool: str, length: Sequence[float], row: int) -> Iterator[str]:
    """Yield the guard for a tool length, `H1`, that a row of the toolpath activates."""
    parameters = [f"#{LENGTH + k}" for k in range(_AXES)]
    check = parameters, length, _LENGTHS.format(tool[1:], offset_text(length))
    yield from _stops([check], FIRST_LENGTH_LABEL + 2 * row)


def _stops(checks: Sequence[tuple[Sequence[str], Sequence[float], str]], label: int) -> Iterator[str]:
    for parameters, expected, message in checks:
        wanted = [*expected, *(0.0 for _ in parameters[len(expected) :])]
        off = [f"ABS[{one}{f'-[{value:.6f}]' if value else ''}]" for one, value in zip(parameters, wanted, strict=True)]
        for place in range(0, len(off), _TERMS):
            condition = "+".join(off[place : place + _TERMS])
            yield from (
                f"o{label} if [[{condition}] GT {WITHIN:g}]",
                f"({MESSAGE}{message})",
                "M0",
                "M02",
                f"o{label} endif",
            )
            label += 1


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
