"""`--prefer` and `--strict`: what compensated programs keep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_OPTIONS = (
    click.option(
        "--prefer",
        type=click.Choice(["accuracy", "position-only"]),
        default="accuracy",
        show_default=True,
        help="Correct all six axes, or the tool tip alone with A, B and C as programmed.",
    ),
    click.option(
        "--strict",
        is_flag=True,
        help="Refuse a program that misses the chord error, or in which the control would not keep a feed.",
    ),
)


def keeping_options(function: _Function) -> _Function:
    """Give a command `prefer` and `strict`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function
