"""Options of every command that talks to a real instrument: which one, where it is, how fast its line is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.shop import shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def instrument_options(*, required: bool) -> Callable[[_Function], _Function]:
    """Give a command `--instrument`, `--port` and `--baud`; the first two required unless the shop has set them."""
    options = (
        shop_option(
            "--instrument",
            setting="instrument",
            required=required,
            metavar="NAME",
            help="Name of an instrument (`dbbstation instruments`), or a protocol file.",
        ),
        shop_option(
            "--port", setting="port", required=required, help="Port name, or a URL such as socket://127.0.0.1:4001."
        ),
        shop_option(
            "--baud",
            setting="baud",
            type=click.IntRange(min=1),
            help="Baud rate, where the instrument is not set to the usual one.",
        ),
    )

    def give(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return give
