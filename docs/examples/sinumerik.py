"""An NC dialect of one's own: `--dialect sinumerik.py`. Main programs of a Siemens Sinumerik 840D, as far as they go here.

Words after the programming manual "Fundamentals": G4 F for a dwell in seconds, MSG(...) for messages, G60 and G64 for exact
stop and continuous path, G641 ADIS= for a bound of rounding, G53 for one line in machine coordinates. What this control should
not be given (a message without a stop, an end without M2 or M30) has no method, and is refused by name.
"""

from __future__ import annotations

import math
import re

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.nc.dialect import plain
from dbbstation.nc.toolpath import Ending, RowKind, ToolpathBuilder
from dbbstation.nc.words import WordDialect, digits

SYSTEMS = ("G54", "G55", "G56", "G57")
BEGIN = "G90 G94 G71 G17 G40"
GUARD = 'MSG("work offset and tool length must be zero: check, then continue")'
NAMES = re.compile(r'MSG\("(?P<text>[^"]*)"\)')


class Sinumerik(WordDialect):
    """One method for each thing that a program can hold; `read` understands what these write."""

    name = "sinumerik"
    extension = ".mpf"
    what = "Siemens Sinumerik 840D"

    def begin(self, toolpath):  # noqa: ARG002 - the same for every program
        """Absolute, feed per minute, millimetres, arcs in XY, no cutter compensation."""
        return (BEGIN,)

    def end(self, toolpath):
        """M2 or M30."""
        if toolpath.ending is Ending.TEXT:
            raise self.cannot_say("an end without M2 or M30")
        return (toolpath.ending.value,)

    def rapid(self, words):
        """Return G0."""
        return f"G0 {words}"

    def feed(self, words, feed):
        """Return G1, F where it changes."""
        return f"G1 {words}" if feed is None else f"G1 {words} F{digits(feed)}"

    def in_machine(self, move):
        """G53, for one line."""
        return f"G53 {move}"

    def corner(self, corner_mm):
        """Exact stop, continuous path, or within a bound."""
        if corner_mm == 0.0:
            return "G60"
        return "G64" if math.isinf(corner_mm) else f"G641 ADIS={digits(corner_mm)}"

    def dwell(self, seconds):
        """Return G4, with the seconds in F."""
        return f"G4 F{digits(seconds)}"

    def pause(self, text):
        """M0, with what the operator is to do."""
        return f'{message(text)}\nM0\nMSG("")' if text else "M0"

    def optional_stop(self):
        """Return M1."""
        return "M1"

    def comment(self, text):
        """Behind a semicolon."""
        return f"; {plain(text)}".rstrip()

    def function(self, words):
        """Spindle and coolant; tools are changed by hand."""
        if re.search("[^SM0-9. ]|M6", words):
            raise self.cannot_say(words)
        return words

    def system(self, text):
        """G54 to G57; what others call G58 and G59 are offsets of another kind here."""
        if text not in SYSTEMS:
            raise self.cannot_say(text)
        return text

    def guard(self, holds):  # noqa: ARG002 - the operator looks at all of them
        """A stop: the operator looks, since the program does not."""
        return [GUARD, "M0", 'MSG("")']

    def read(self, text, name, *, start=None):
        """Return what a program commands, line by line."""
        return _Reader(name, start).read(text)


def message(text):
    """A text that the control shows."""
    return f'MSG("{plain(text).replace(chr(34), chr(39))}")'


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
        elif first in SYSTEMS:
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
        if message(self.shown) != GUARD:
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
