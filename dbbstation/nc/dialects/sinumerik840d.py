"""Main programs of Siemens SINUMERIK 840D sl, with plain axes: A, B and C are positions of axes, without TRAORI.

Sources: SINUMERIK 840D sl, Programming Manual Fundamentals, edition 11/2006, 6FC5398-1BP10-2BA0, by page [F], its edition
03/2010, 6FC5398-1BP20-1BA0, by chapter [F 2010], and Function Manual Basic Functions, edition 11/2006, 6FC5397-0BP10-2BA0, part
B1 [B1].
"""

from __future__ import annotations

import math
import re
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError
from dbbstation.nc.toolpath import Ending, RowKind, Toolpath, ToolpathBuilder
from dbbstation.nc.words import WordDialect

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats

BEGIN = "G90 G94 G710 G17 G40"
"""Absolute, feed per minute, lengths and F in millimetres, XY plane, no cutter compensation [F 2010, chapters 7, 8 and 10]."""

GUARD = 'MSG("work offset and tool length must be zero: check, then continue")'
_MESSAGE = re.compile(r'MSG\("(?P<text>[^"]*)"\)')
_NUMBER = re.compile(r"N\d+ ")
_WORD = re.compile(r"([XYZABCF])(-?\d+\.?\d*)")


class Sinumerik840D(WordDialect):
    """A table for writing. A message without a stop, and an end without M2 or M30, have no entry and are refused by name.

    - MSG and G4 F in seconds are in [F 2010, chapter 14]. The operator checks offsets at a stop.
    - SUPA suppresses all offsets in one line; after G53 a basic frame applies [F, page 100].
    - G60, G64 and G641 are in [F 2010, chapter 11]. With G641, rounding begins ADIS before a corner, and so leaves it by less.
      The speed is at most ADIS per interpolation cycle [B1, page 22]: a larger `--chord-um` allows more.
    - M3 to M5 and M7 to M9 mean on every control what they mean here; other M functions are those of the machine's maker.
    - G54 to G57 are the work offsets that other controls have, too [F, page 100].
    """

    name = "sinumerik840d"
    extension = ".mpf"
    what = "Siemens SINUMERIK 840D sl, plain axes"
    longest_name = 24  # [F, page 62]
    name_letters = "A-Za-z0-9_"
    words = MappingProxyType(
        {
            "begin": BEGIN,
            "rapid": "G0 {words}",
            "feed": "G1 {words}",
            "in machine": "SUPA {move}",
            "exact": "G60",
            "continuous": "G64",
            "within": "G641 ADIS={mm}",
            "dwell": "G4 F{seconds}",
            "pause": "M0",
            "pause with text": 'MSG("{text}")\nM0\nMSG("")',
            "optional stop": "M1",
            "comment": "; {text}",
            "M2": "M2",
            "M30": "M30",
        }
    )
    functions = "S[0-9.]+|M0?[345789]"
    systems = "G5[4-7]"
    instead = MappingProxyType({'"': "'"})

    def file_name(self, stem: str, run: int) -> str:
        """Return a name that begins with two letters, so that a program can call it."""
        return super().file_name(stem if re.match("[A-Za-z]{2}", stem) else f"NC_{stem}", run)

    def guard(self, holds: Mapping[str, Sequence[float]]) -> Iterable[str]:  # noqa: ARG002 - the operator checks all
        return (GUARD, "M0", 'MSG("")')

    def read(self, text: str, name: str, *, start: Floats | None = None) -> Toolpath:  # type: ignore[override]  # takes no setup
        """Return what a program commands, in the words of the table."""
        reader = _Reader(name, start)
        for number, line in enumerate(text.splitlines(), 1):
            code, _, comment = _NUMBER.sub("", line, count=1).partition(";")
            if comment:
                reader.path.say(RowKind.COMMENT, comment.strip(), line=number)
            if code.strip() and not reader.take(code.strip(), number):
                raise InputError.of(name, f"`{code.strip()}` is not read", "write it otherwise", number, 1)
        return reader.path.built()


class _Reader:
    def __init__(self, name: str, start: Floats | None) -> None:
        self.path = ToolpathBuilder(name, start)
        self.pose = self.path.pose
        self.feed, self.shown = math.nan, ""

    def take(self, code: str, line: int) -> bool:
        """Take over one line; return whether it was understood."""
        first, *words = code.split()
        said = {"M1": RowKind.OPTIONAL_STOP} | dict.fromkeys(("G54", "G55", "G56", "G57"), RowKind.SYSTEM)
        corners = {"G60": 0.0, "G64": math.inf}
        shown, dwell = _MESSAGE.fullmatch(code), re.fullmatch(r"G4 F([\d.]+)", code)
        within = re.fullmatch(r"G641 ADIS=([\d.]+)", code)
        if shown:
            self.shown = shown["text"]
        elif code == "M0":
            self._stop(line)
        elif code in said:
            self.path.say(said[code], "" if code == "M1" else code, line=line)
        elif code in {"M2", "M30"}:
            self.path.ending = Ending(code)
        elif dwell:
            self.path.dwell(float(dwell[1]), line=line)
        elif within or code in corners:
            self.path.corner_mm = float(within[1]) if within else corners[code]
        elif first in {"SUPA", "G0", "G1"}:
            return self._move([first, *words], line)
        elif all(re.fullmatch(Sinumerik840D.functions, word) for word in (first, *words)):
            self.path.say(RowKind.FUNCTION, code, line=line)
        else:
            return code == BEGIN
        return True

    def _stop(self, line: int) -> None:
        if f'MSG("{self.shown}")' != GUARD:
            self.path.say(RowKind.PAUSE, self.shown, line=line)
        self.shown = ""

    def _move(self, words: list[str], line: int) -> bool:
        in_machine = words[0] == "SUPA"
        motion, *rest = words[in_machine:] or [""]
        found = [_WORD.fullmatch(word) for word in rest]
        numbers = {word[1]: float(word[2]) for word in found if word}
        if motion not in {"G0", "G1"} or not numbers or len(numbers) < len(rest):
            return False
        self.feed, self.pose = numbers.pop("F", self.feed), self.pose.copy()
        self.pose[["XYZABC".index(axis) for axis in numbers]] = list(numbers.values())
        if np.isnan(self.pose).any() or (motion == "G1" and not self.feed > 0.0):
            return False
        if motion == "G0":
            self.path.rapid(self.pose, line=line, in_machine=in_machine)
        else:
            self.path.feed(self.pose[None], self.feed, line=line, in_machine=in_machine)
        return True
