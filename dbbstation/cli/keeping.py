"""`--prefer` and `--accept-chord-um`: what compensated programs keep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_OPTIONS = (
    click.option(
        "--prefer",
        type=click.Choice(["accuracy", "feed", "position-only"]),
        help="What to keep where chord error and feed cannot both be kept: the chord error at a lower feed, the feed, or "
        "both with A, B and C uncorrected [default: refuse the program].",
    ),
    click.option(
        "--accept-chord-um",
        "accepted_um",
        type=Finite(0.0, 1000.0, min_open=True),
        metavar="UM",
        help="Accept a chord error up to this where --chord-um is missed [µm].",
    ),
)


def keeping_options(function: _Function) -> _Function:
    """Give a command `prefer` and `accepted_um`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function
