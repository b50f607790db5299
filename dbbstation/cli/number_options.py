"""`--decimal` and `--separator`: for every command that reads a table from elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.shop import shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.formats.number_language import NumberLanguage

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_BY_NAME = {"comma": ",", "semicolon": ";", "tab": "\t"}


def number_options(function: _Function) -> _Function:
    """Give a command the options; it takes `decimal` and `separator` and passes them to `number_language`."""
    options = (
        shop_option(
            "--decimal",
            setting="numbers.decimal",
            type=click.Choice([".", ","]),
            help="Decimal sign in the table  [default: a dot].",
        ),
        shop_option(
            "--separator",
            setting="numbers.separator",
            type=click.Choice([*_BY_NAME, *_BY_NAME.values()]),
            metavar="[comma|semicolon|tab]",
            help="What stands between the columns of the table  [default: comma; semicolon with a decimal comma].",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


def number_language(decimal: str | None, separator: str | None) -> NumberLanguage:
    """Return how the numbers of the table are written.

    Raises:
        InputError: decimal sign and separator are alike.
    """
    from dbbstation.files.formats.number_language import PLAIN, NumberLanguage

    decimal = decimal or PLAIN.decimal
    usual = ";" if decimal == "," else PLAIN.separator
    return NumberLanguage(decimal, usual if separator is None else _BY_NAME.get(separator, separator))
