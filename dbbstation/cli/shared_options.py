"""Options that tasks declare, for commands that are not made of a task."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.declared import option_of
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import options_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.tasks.declare import TaskParameter

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def _as_options(declared: Callable[..., None]) -> Callable[[_Function], _Function]:
    def give(function: _Function) -> _Function:
        for one in reversed(options_of(declared).values()):
            function = click.option(cls=lambda _names, one=one: _checked(one))(function)  # type: ignore[arg-type]
        return function

    return give


def _checked(one: TaskParameter) -> click.Parameter:
    option = option_of(one)
    option.callback = lambda _context, _option, value: one.checked(value)
    return option


@_as_options
def chosen_tests_options(tests: o.Tests = (), exclude: o.Exclude = ()) -> None:
    """Give a command both, tuples of names."""


@_as_options
def source_file_option(source_files: o.SourceFiles = ()) -> None:
    """Give a command this option, a tuple of paths."""


@_as_options
def number_options(decimal: o.Decimal = None, separator: o.Separator = None) -> None:
    """Give a command both, for `number_language`."""


@_as_options
def filter_option(filter: o.Filter = "none") -> None:  # noqa: A002 - the standard's word
    """Give a command this option, for `Filter.of_word`."""
