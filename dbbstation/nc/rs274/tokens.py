"""Words, parameter settings and comments of one line of RS274/NGC, each with its column."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from dbbstation.errors import Problem
from dbbstation.nc.rs274.expressions import NUMBER, ValueReader, closed_up

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_TOKEN = re.compile(
    rf"""[ \t]*+(?:
        (?P<letter>[A-Za-z@^])[ \t]*+(?P<number>{NUMBER.pattern})
      | (?P<word>[A-Za-z@^])(?=[ \t]*+[-+]?[ \t]*+(?:[\[#]|[A-Za-z]{{2,6}}[ \t]*+\[))
      | (?P<setting>\#)
      | \((?P<comment>(?:[^()]|\([^()]*+\))*+)\)
      | ;(?P<rest>.*+)
      | (?P<end>\Z)
    )""",
    re.VERBOSE,
)

LARGEST = {"N": 99_999_999.0, "F": 1e9, "S": 1e6, **dict.fromkeys("ABC", 36_000.0)}
LARGEST_OTHER = 100_000.0
"""Greatest number after each letter: a hundred metres, a hundred turns, a dwell of a day. A greater number is a typing
error, and would become millions of points."""

_NOT_READ = {
    "[": ("an expression ([ ]) without its letter", "write the letter before it"),
    "/": ("a line that a switch of the control skips (/)", "say how the switch stands: --block-delete on, or off"),
    "(": ("a comment without its end", "close it with ) before the line ends"),
    "%": ("% stands alone on the first and the last line", "remove it"),
}


class Word(NamedTuple):
    """A capital letter with its number.

    Attributes:
        column: from 1.
    """

    letter: str
    value: float
    column: int

    def counts(self, least: float) -> bool:
        """Return whether the number is a whole one from `least` on."""
        return self.value >= least and self.value == int(self.value)


class ParameterSetting(NamedTuple):
    """A parameter, by number or lower-case name, and its value after the line."""

    parameter: int | str
    value: float
    column: int


class Comment(NamedTuple):
    """A comment.

    Attributes:
        bracketed: LinuxCNC acts on bracketed comments only.
        column: from 1.
    """

    text: str
    bracketed: bool
    column: int


class BadLine(Exception):  # noqa: N818 - never leaves this package
    """One fault in one line."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        super().__init__(str(problem))


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a program, for messages.

    Attributes:
        line: from 1; lines of subprograms in other files follow.
        within: the line in such a file; 0 in the program.
    """

    file: str
    line: int
    within: int = 0

    def __str__(self) -> str:
        return f"line {self.within} of {self.file}" if self.within else f"line {self.line}"

    def fault(self, column: int, what: str, remedy: str) -> BadLine:
        """Return the exception for a fault at this place."""
        return BadLine(Problem(self.file, self.within or self.line, column, what, remedy))


def unknown_value(_which: int | str) -> float:
    """Return a placeholder value of any parameter for a line that is inspected, but not run."""
    return math.nan


def tokens(
    text: str, place: Place, value_of: Callable[[int | str], float | None] = unknown_value
) -> Iterator[Word | ParameterSetting | Comment]:
    """Yield the tokens of a line, in order.

    Raises:
        BadLine: text that is no token, or has no value.
    """
    position = 0
    while True:
        match = _TOKEN.match(text, position)
        if match is None:
            raise _unreadable(text, position, place)
        position = match.end()
        kind = match.lastgroup
        if kind == "number":
            yield _number(match, place)
        elif kind == "end":
            return
        elif kind in {"word", "setting"}:
            reader = ValueReader(text, place, value_of)
            reader.position = match.end() if kind == "word" else match.start("setting")
            yield _computed(match, reader, place)
            position = reader.position
        else:
            # A comment within a comment, which LinuxCNC refuses, is part of it: what ends it at the first ) refuses the rest.
            said = match[kind or 0].replace("(", "[").replace(")", "]") if kind == "comment" else match[kind or 0]
            yield Comment(said, kind == "comment", match.start(kind or 0))


def _computed(match: re.Match[str], reader: ValueReader, place: Place) -> Word | ParameterSetting:
    if match["word"] is not None:
        return _word(match["word"], reader.value(), match.start("word") + 1, place)
    column, which = match.start("setting") + 1, reader.parameter()
    if reader.blanks() != "=":
        raise place.fault(column, "a parameter (#) without a letter before it or = behind it", "write #1=5 or X#1")
    reader.position += 1
    return ParameterSetting(which, reader.expression(), column)


def _number(match: re.Match[str], place: Place) -> Word:
    letter, number = match.group("letter", "number")
    number = closed_up(number)
    if letter in "Nn" and not number.isdecimal():
        raise place.fault(match.start("letter") + 1, f"N{number} is not a line number", "write a whole number, or none")
    return _word(letter, float(number), match.start("letter") + 1, place)


def _word(letter: str, value: float, column: int, place: Place) -> Word:
    letter = letter.upper()
    largest = LARGEST.get(letter, LARGEST_OTHER)
    if abs(value) > largest:
        what = f"the number after {letter} is {value:g}, beyond {largest:g}"
        raise place.fault(column, what, "check its decimal point")
    return Word(letter, value, column)


def _unreadable(text: str, position: int, place: Place) -> BadLine:
    while text[position] in " \t":
        position += 1
    letter = text[position]
    if letter.isascii() and letter.isalpha():
        what = f"the letter {letter.upper()} has no number"
        return place.fault(position + 1, what, f"write a number after {letter.upper()}, or remove it")
    what, remedy = _NOT_READ.get(letter, (f"{letter!r} does not belong in a program", "remove it"))
    return place.fault(position + 1, what, remedy)
