"""Numbers, parameters and expressions of RS274/NGC [3.5.2 and 3.5.3; LinuxCNC, O-codes and G-code overview]."""

from __future__ import annotations

import math
import operator
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.nc.rs274.tokens import Place

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
            raise self._place.fault(
                at + 1, "a number is missing here", "write a number, a parameter or [an expression]"
            )
        return self._function(word)

    def expression(self) -> float:
        """Return the value of an expression. Fanuc's macros write it without brackets behind =."""
        return self._level(0)

    def bracket(self) -> float:
        """Return the value of an expression in brackets."""
        at = self._expect("[")
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._place.fault(at + 1, f"more than {DEEPEST} nested brackets", "write it in several lines")
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
                raise self._place.fault(at + 1, "the name of a parameter lacks its closing >", "close it")
            name = closed_up(self._text[self.position + 1 : end]).lower()
            self.position = end + 1
            return name
        number = self.value()
        if math.isnan(number):
            return 1
        if abs(number - round(number)) > EQUAL or not 1 <= round(number) <= MOST_PARAMETER:
            raise self._place.fault(
                at + 1, f"#{number:g} is no parameter", f"use a whole number from 1 to {MOST_PARAMETER}"
            )
        return round(number)

    def blanks(self) -> str:
        """Skip blanks and return the next character; empty at the end."""
        while self._text[self.position : self.position + 1] in {" ", "\t"}:
            self.position += 1
        return self._text[self.position : self.position + 1]

    def _parameter_value(self) -> float:
        at, which = self.position, self.parameter()
        value = self._value_of(which)
        if value is None:
            what = f"{shown(which)} is read before the program sets it: its value is the control's"
            raise self._place.fault(
                at + 1, what, "set it in the program, or give LinuxCNC's parameter file with --parameters"
            )
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
            raise self._place.fault(
                at + 1, f"{word[0]!r} is no function", f"write a number, or one of {', '.join(_FUNCTIONS)}"
            )
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
            raise self._place.fault(at + 1, "this has no value", "check the expression")
        return value

    def _expect(self, letter: str) -> int:
        """Skip a character; return its index."""
        found, at = self.blanks(), self.position
        if found != letter:
            raise self._place.fault(at + 1, f"{letter!r} is missing here", "check the brackets of the expression")
        self.position += 1
        return at


MOST_PARAMETER = 5602
"""Greatest number of a parameter in LinuxCNC [RS274NGC_MAX_PARAMETERS]."""
