"""`--filter`: the filter of G, F and H."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.circles.path import Filter

_Function = TypeVar("_Function", bound="Callable[..., Any]")

FILTERS = {"none": 0, "15": 15, "30": 30, "50": 50, "150": 150}


def filter_option(function: _Function) -> _Function:
    """Give a command this option as `cut_off`."""
    return click.option(
        "--filter",
        "cut_off",
        type=click.Choice(list(FILTERS)),
        default="none",
        show_default=True,
        help="Filter of G, F and H: its cut-off in undulations per revolution. Gaussian; 30 is cut off sharply, as for tolerances.",
    )(function)


def filter_of(cut_off: str) -> Filter:
    """Return the filter of a word."""
    from dbbstation.circles.path import Filter

    return Filter(FILTERS[cut_off])
