"""Words and comments of one line of RS274/NGC, each with its column."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from dbbstation.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator

# White space inside a number is legal: `X1 0` is X10 to LinuxCNC, and so it must be here. Every repeat is possessive
# (`*+`), so that no line is gone through twice.
_TOKEN = re.compile(
    r"""[ \t]*+(?:
        (?P<letter>[A-Za-z])[ \t]*+
        (?P<number>[+-]?+[ \t]*+(?:[0-9][0-9 \t]*+(?:\.[0-9 \t]*+)?+|\.[ \t]*+[0-9][0-9 \t]*+))
      | \((?P<comment>[^()]*+)\)
      | ;(?P<rest>.*+)
      | (?P<end>\Z)
    )""",
    re.VERBOSE,
)

LARGEST = {"N": 99_999_999.0, "F": 1e9, "S": 1e6, **dict.fromkeys("ABC", 36_000.0)}
LARGEST_OTHER = 100_000.0
"""Greatest size of a number after each letter: a hundred metres, a hundred turns, a dwell of a day. What is beyond is a
slip of the pen, and would be drawn out into millions of points before any limit of the machine is looked at."""

_NOT_READ = {
    "#": ("a parameter (#) is not read", "write its value"),
    "[": ("an expression ([ ]) is not read", "write its value"),
    "/": ("a line that can be skipped (/) is not read", "decide: remove the line, or the slash"),
    "@": ("polar coordinates (@, ^) are not read", "write X and Y"),
    "^": ("polar coordinates (@, ^) are not read", "write X and Y"),
    "(": ("a comment without its end, or inside another", "close it with ) before the line ends"),
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
    """A line of a program, for messages."""

    file: str
    line: int

    def fault(self, column: int, what: str, remedy: str) -> BadLine:
        """Return the exception for a fault in this place."""
        return BadLine(Problem(self.file, self.line, column, what, remedy))


def tokens(text: str, place: Place) -> Iterator[Word | Comment]:
    """Words and comments of a line, in order.

    Raises:
        BadLine: something that is neither.
    """
    position = 0
    while True:
        match = _TOKEN.match(text, position)
        if match is None:
            raise _unreadable(text, position, place)
        position = match.end()
        kind = match.lastgroup
        if kind == "number":
            yield _word(match, place)
        elif kind == "end":
            return
        else:
            yield Comment(match[kind or 0], kind == "comment", match.start(kind or 0))


def _word(match: re.Match[str], place: Place) -> Word:
    letter, number = match.group("letter", "number")
    letter, column = letter.upper(), match.start("letter") + 1
    number = number.replace(" ", "").replace("\t", "")
    if letter == "N" and not number.isdecimal():
        raise place.fault(column, f"N{number} is no line number", "write a whole number, or none")
    value = float(number)
    largest = LARGEST.get(letter, LARGEST_OTHER)
    if abs(value) > largest:
        what = f"the number after {letter} is {value:g}, beyond {largest:g}"
        raise place.fault(column, what, "check its decimal point")
    return Word(letter, value, column)


def _unreadable(text: str, position: int, place: Place) -> BadLine:
    while text[position] in " \t":
        position += 1
    letter = text[position]
    following = text[position + 1 :].lstrip()[:1]
    if letter.isascii() and letter.isalpha():
        if following in {"#", "["}:
            return place.fault(position + 1, *_NOT_READ[following])
        what = f"the letter {letter.upper()} has no number"
        return place.fault(position + 1, what, f"write a number after {letter.upper()}, or remove it")
    what, remedy = _NOT_READ.get(letter, (f"{letter!r} does not belong in a program", "remove it"))
    return place.fault(position + 1, what, remedy)
