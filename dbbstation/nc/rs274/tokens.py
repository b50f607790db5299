"""Words, expressions, parameter settings and comments of one line of RS274/NGC, each with its column."""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from dbbstation.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


NUMBER = re.compile(r"[+-]?+[ \t]*+(?:[0-9][0-9 \t]*+(?:\.[0-9 \t]*+)?+|\.[ \t]*+[0-9][0-9 \t]*+)")
"""Pattern of a number. White space inside it is legal: LinuxCNC reads `X1 0` as X10. Every repeat is possessive, so
that no line is searched twice."""

_WORD = re.compile(r"[A-Za-z]+")
_OPERATOR = re.compile(r"\*\*|[-+*/]|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE", re.IGNORECASE)

EQUAL = 1e-4
"""EQ and NE treat numbers that differ by less as equal [LinuxCNC, TOLERANCE_EQUAL]."""

DEEPEST = 50
"""Greatest depth of nested brackets; LinuxCNC allows more, but programs need fewer."""


def _power(base: float, exponent: float) -> float:
    if base < 0.0 and exponent != int(exponent):
        raise ValueError("a negative number to a fractional power")
    return float(base**exponent)


def _truth(made: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    return lambda one, other: float(made(one, other))


_LEVELS: tuple[dict[str, Callable[[float, float], float]], ...] = (
    {
        "AND": _truth(lambda a, b: a != 0.0 and b != 0.0),
        "OR": _truth(lambda a, b: a != 0.0 or b != 0.0),
        "XOR": _truth(lambda a, b: (a != 0.0) != (b != 0.0)),
    },
    {
        "EQ": _truth(lambda a, b: abs(a - b) < EQUAL),
        "NE": _truth(lambda a, b: abs(a - b) >= EQUAL),
        "GT": _truth(operator.gt),
        "GE": _truth(operator.ge),
        "LT": _truth(operator.lt),
        "LE": _truth(operator.le),
    },
    {"+": operator.add, "-": operator.sub},
    {"*": operator.mul, "/": operator.truediv, "MOD": lambda a, b: a - abs(b) * math.floor(a / abs(b))},
    {"**": _power},
)

_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "ABS": abs,
    "ACOS": lambda x: math.degrees(math.acos(x)),
    "ASIN": lambda x: math.degrees(math.asin(x)),
    "COS": lambda x: math.cos(math.radians(x)),
    "EXP": math.exp,
    "FIX": math.floor,
    "FUP": math.ceil,
    "LN": math.log,
    "ROUND": lambda x: math.copysign(math.floor(abs(x) + 0.5), x),
    "SIN": lambda x: math.sin(math.radians(x)),
    "SQRT": math.sqrt,
    "TAN": lambda x: math.tan(math.radians(x)),
}


def closed_up(text: str) -> str:
    """Return a text without blanks and tabs."""
    return text.replace(" ", "").replace("\t", "")


def shown(which: int | str) -> str:
    """Return a parameter as people write it: #5, #<depth>."""
    return f"#{which}" if isinstance(which, int) else f"#<{which}>"


class ValueReader:
    """Reads successive values of one line from a position.

    Args:
        value_of: value of a parameter by number or lower-case name; None if undefined. NaN stands for values that are
            not needed.
    """

    def __init__(self, text: str, place: Place, value_of: Callable[[int | str], float | None]) -> None:
        self._text, self._place, self._value_of = text, place, value_of
        self.position = 0
        self._depth = 0

    def value(self) -> float:
        """Return a number, parameter, expression in brackets, or function of one.

        Raises:
            BadLine: there is none, or it has no value.
        """
        letter, at = self.blanks(), self.position
        number = NUMBER.match(self._text, at)
        if number is not None:
            self.position = number.end()
            return float(closed_up(number[0]))
        if letter in {"+", "-"}:
            self.position += 1
            return self.value() if letter == "+" else -self.value()
        if letter == "#":
            return self._parameter_value()
        if letter == "[":
            return self.bracket()
        word = _WORD.match(self._text, self.position)
        if word is None:
            raise self._fault(at, "a number is missing here", "write a number, a parameter or [an expression]")
        return self._function(word)

    def expression(self) -> float:
        """Return the value of an expression. Fanuc's macros write it without brackets behind =."""
        return self._level(0)

    def bracket(self) -> float:
        """Return the value of an expression in brackets."""
        at = self._expect("[")
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._fault(at, f"more than {DEEPEST} nested brackets", "write it in several lines")
        value = self._level(0)
        self._expect("]")
        self._depth -= 1
        return value

    def parameter(self) -> int | str:
        """Return the number or lower-case name of the parameter at this position."""
        at = self._expect("#")
        if self.blanks() == "<":
            end = self._text.find(">", self.position)
            if end < 0:
                raise self._fault(at, "the name of a parameter lacks its closing >", "close it")
            name = closed_up(self._text[self.position + 1 : end]).lower()
            self.position = end + 1
            return name
        number = self.value()
        if math.isnan(number):
            return 1
        if abs(number - round(number)) > EQUAL or not 1 <= round(number) <= MOST_PARAMETER:
            raise self._fault(at, f"#{number:g} is no parameter", f"use a whole number from 1 to {MOST_PARAMETER}")
        return round(number)

    def blanks(self) -> str:
        """Skip blanks and return the next character; empty at the end."""
        while self._text[self.position : self.position + 1] in {" ", "\t"}:
            self.position += 1
        return self._text[self.position : self.position + 1]

    def _fault(self, at: int, what: str, remedy: str) -> BadLine:
        return self._place.fault(at + 1, what, remedy)

    def _parameter_value(self) -> float:
        at, which = self.position, self.parameter()
        value = self._value_of(which)
        if value is None:
            what = f"{shown(which)} is read before the program sets it: its value is the control's"
            raise self._fault(at, what, "set it in the program, or give LinuxCNC's parameter file with --parameters")
        return value

    def _function(self, word: re.Match[str]) -> float:
        at, name = self.position, word[0].upper()
        self.position = word.end()
        if name == "EXISTS":
            self._expect("[")
            which = self.parameter()
            self._expect("]")
            return float(self._value_of(which) is not None)
        if name != "ATAN" and name not in _FUNCTIONS:
            raise self._fault(at, f"{word[0]!r} is no function", f"write a number, or one of {', '.join(_FUNCTIONS)}")
        first = self.bracket()
        if name != "ATAN":
            return self._computed(at, _FUNCTIONS[name], first)
        self._expect("/")
        return math.degrees(math.atan2(first, self.bracket()))

    def _level(self, level: int) -> float:
        if level == len(_LEVELS):
            return self.value()
        value = self._level(level + 1)
        while True:
            self.blanks()
            sign = _OPERATOR.match(self._text, self.position)
            made = None if sign is None else _LEVELS[level].get(sign[0].upper())
            if sign is None or made is None:
                return value
            at, self.position = self.position, sign.end()
            value = self._computed(at, made, value, self._level(level + 1))

    def _computed(self, at: int, made: Callable[..., float], *values: float) -> float:
        if any(math.isnan(value) for value in values):
            return math.nan
        try:
            value = float(made(*values))
        except (ArithmeticError, ValueError):
            value = math.nan
        if not math.isfinite(value) or isinstance(value, complex):
            raise self._fault(at, "this has no value", "check the expression")
        return value

    def _expect(self, letter: str) -> int:
        """Skip a character; return its index."""
        found, at = self.blanks(), self.position
        if found != letter:
            raise self._fault(at, f"{letter!r} is missing here", "check the brackets of the expression")
        self.position += 1
        return at


MOST_PARAMETER = 5602
"""Greatest number of a parameter in LinuxCNC [RS274NGC_MAX_PARAMETERS]."""


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
