"""An NC dialect of one's own: `--dialect sinumerik.py`. Main programs of a Siemens Sinumerik 840D, as far as they go here.

Words after the programming manual "Fundamentals": G4 F for a dwell in seconds, MSG(...) for messages, G60 and G64 for exact
stop and continuous path, G641 ADIS= for a bound of rounding, G53 for one line in machine coordinates. What this control should
not be given (a message without a stop, an end without M2 or M30) has no entry in the table, and is refused by name.
"""

from __future__ import annotations

import math
import re
from types import MappingProxyType

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.nc.toolpath import Ending, RowKind, ToolpathBuilder
from dbbstation.nc.words import WordDialect

BEGIN = "G90 G94 G71 G17 G40"
GUARD = 'MSG("work offset and tool length must be zero: check, then continue")'
NAMES = re.compile(r'MSG\("(?P<text>[^"]*)"\)')


class Sinumerik(WordDialect):
    """A table of what is written; `read` understands it."""

    name = "sinumerik"
    extension = ".mpf"
    what = "Siemens Sinumerik 840D"
    words = MappingProxyType(
        {
            "begin": BEGIN,
            "rapid": "G0 {words}",
            "feed": "G1 {words}",
            "in machine": "G53 {move}",
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
    functions = r"S[0-9.]+|M(?!0?6$)[0-9]+"
    """Spindle and coolant; tools are changed by hand."""
    systems = "G5[4-7]"
    """Others call G58 and G59 work systems; here they are offsets of another kind."""
    instead = MappingProxyType({'"': "'"})

    def guard(self, holds):  # noqa: ARG002 - the operator looks at all of them
        """A stop: the operator looks, since the program does not."""
        return [GUARD, "M0", 'MSG("")']

    def read(self, text, name, *, start=None):
        """Return what a program commands, line by line."""
        return _Reader(name, start).read(text)


class _Reader:
    def __init__(self, name, start):
        self.name = name
        self.path = ToolpathBuilder(name, start)
        self.pose = np.full(6, np.nan) if start is None else np.array(start, dtype=float)
        self.feed, self.shown = math.nan, ""

    def read(self, text):
        for number, line in enumerate(text.splitlines(), 1):
            code, _, comment = re.sub(r"^N\d+ ", "", line).partition(";")
            if comment:
                self.path.say(RowKind.COMMENT, comment.strip(), line=number)
            if code.strip() and not self.take(code.strip(), number):
                raise InputError([Problem(self.name, number, 0, f"`{code.strip()}` is not read", "write it otherwise")])
        return self.path.built()

    def take(self, code, line):
        """Take over one line; return whether it was understood."""
        first, *words = code.split()
        shown = NAMES.fullmatch(code)
        if shown:
            self.shown = shown["text"]
        elif first == "M0":
            self.stop(line)
        elif first == "M1":
            self.path.say(RowKind.OPTIONAL_STOP, "", line=line)
        elif first in {"M2", "M30"}:
            self.path.ending = Ending(first)
        elif first == "G4":
            self.path.dwell(float(words[0][1:]), line=line)
        elif re.fullmatch(Sinumerik.systems, first):
            self.path.say(RowKind.SYSTEM, first, line=line)
        elif first in {"G60", "G64", "G641"}:
            self.path.corner_mm = {"G60": 0.0, "G64": math.inf}.get(first) if not words else float(words[0][5:])
        elif first in {"G53", "G0", "G1"}:
            self.move([first, *words], line)
        elif re.fullmatch(r"(S[\d.]+|M\d+)( M\d+)*", code):
            self.path.say(RowKind.FUNCTION, code, line=line)
        else:
            return code == BEGIN
        return True

    def stop(self, line):
        """A stop with the message before it, or the guard."""
        if f'MSG("{self.shown}")' != GUARD:
            self.path.say(RowKind.PAUSE, self.shown, line=line)
        self.shown = ""

    def move(self, words, line):
        """A move to the axes that it names."""
        numbers = {word[0]: float(word[1:]) for word in words if word[0] != "G"}
        self.feed = numbers.pop("F", self.feed)
        self.pose = self.pose.copy()
        self.pose[["XYZABC".index(axis) for axis in numbers]] = list(numbers.values())
        if "G0" in words:
            self.path.rapid(self.pose, line=line, in_machine=words[0] == "G53")
        else:
            self.path.feed(self.pose[None], self.feed, line=line, in_machine=words[0] == "G53")
