"""`--tests` and `--exclude`: the tests of a command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def _names(_context: click.Context, _parameter: click.Parameter, given: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name.strip() for text in given for name in text.split(",") if name.strip()))


def chosen_tests_options(function: _Function) -> _Function:
    """Give a command both options as `tests` and `exclude`, tuples of names."""
    options = (
        click.option(
            "--tests",
            "tests",
            multiple=True,
            metavar="TEST,...",
            callback=_names,
            help="Take these tests only; may be given more than once.",
        ),
        click.option(
            "--exclude",
            multiple=True,
            metavar="TEST,...",
            callback=_names,
            help="Leave tests out; may be given more than once.",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function
