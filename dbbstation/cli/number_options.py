"""`--decimal` and `--separator`, for tables from elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.output import say
from dbbstation.cli.shop import shop_option, shop_settings

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.formats.number_language import NumberLanguage

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_BY_NAME = {"comma": ",", "semicolon": ";", "tab": "\t"}

SEPARATOR = click.Choice([*_BY_NAME, *_BY_NAME.values()])
"""What may stand between columns."""


def number_options(function: _Function) -> _Function:
    """Give a command `decimal` and `separator`, for `number_language`."""
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
            type=SEPARATOR,
            metavar="[comma|semicolon|tab]",
            help="What stands between the columns of the table  [default: comma; semicolon with a decimal comma].",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


def shops_numbers() -> NumberLanguage | None:
    """Return the number format of the shop's settings, with a note; None if not set.

    For commands in which a file decides first.
    """
    from dbbstation.files.formats.number_language import number_language

    values = shop_settings().values
    found = {key: values[name] for key in ("decimal", "separator") if (name := f"numbers.{key}") in values}
    if not found:
        return None
    texts = ", ".join(f"--{key} {setting.value}" for key, setting in found.items())
    say(f"settings: {texts} (from {next(iter(found.values())).file})")
    return number_language(*(str(found[key].value) if key in found else None for key in ("decimal", "separator")))
