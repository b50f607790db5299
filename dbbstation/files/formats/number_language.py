"""Number format of tables: decimal sign and separator of columns."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from dbbstation.errors import InputError

NUMBER = r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?"
"""Regular expression of a number in files. Unlike NumPy, `float` also accepts `_` and digits of every script."""

_NUMBER = re.compile(NUMBER)

DECIMALS = (".", ",")
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


def is_number(text: str) -> bool:
    """Return whether a text is a number with a decimal point; spaces may surround it."""
    return _NUMBER.fullmatch(text.strip(" \t")) is not None


@dataclass(frozen=True)
class NumberLanguage:
    """Decimal sign and separator of columns; signs between thousands are not allowed.

    Raises:
        InputError: both are commas.
    """

    decimal: str = "."
    separator: str = ","

    def __post_init__(self) -> None:
        if self.decimal == self.separator:
            what = "the decimal sign and the separator of columns are both a comma"
            raise InputError.of("numbers", what, "give `;` or a tab as the separator, or a dot in numbers")

    def number(self, cell: str) -> float:
        """Return the number of a cell, or nan."""
        other = next(sign for sign in DECIMALS if sign != self.decimal)
        plain = cell.replace(self.decimal, ".")
        return math.nan if other in cell or not is_number(plain) else float(plain)

    @property
    def text(self) -> str:
        """Return the expected format in words."""
        sign = "a comma" if self.decimal == "," else "a dot"
        return f"the decimal sign is {sign}, columns are separated by a {SEPARATORS[self.separator]}"


PLAIN = NumberLanguage()
"""Number format of all files that this program writes."""

SIGNS = {name: sign for sign, name in SEPARATORS.items()}
"""Separators of columns by name."""


def number_language(decimal: str | None, separator: str | None) -> NumberLanguage | None:
    """Return the number format of a table, separators by sign or name; None if neither is stated.

    Raises:
        InputError: decimal sign and separator are equal.
    """
    if not decimal and not separator:
        return None
    decimal = decimal or PLAIN.decimal
    usual = ";" if decimal == "," else PLAIN.separator
    return NumberLanguage(decimal, usual if separator is None else SIGNS.get(separator, separator))
