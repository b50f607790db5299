"""Options for the state of a control that a program does not contain: offsets, tool lengths, angles."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_FILE = click.Path(path_type=Path, dir_okay=False)


def numbers_of(text: str, counts: set[int], hint: str) -> list[float]:
    """Return the numbers of `X,Y,Z`, of which there must be one of these counts."""
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(abs(number) < float("inf") for number in numbers):
        wanted = " or ".join({1: "one number", 3: "three", 6: "six"}[count] for count in sorted(counts))
        raise click.BadParameter(f"{text!r}: {wanted} numbers with commas between them are needed", param_hint=hint)
    return numbers


def named_numbers(texts: tuple[str, ...], counts: set[int], hint: str) -> dict[str, list[float]]:
    """Return the numbers of each `NAME=1,2,3`."""
    pairs = [text.partition("=") for text in texts]
    return {name.strip().upper(): numbers_of(numbers, counts, hint) for name, _, numbers in pairs}


_OPTIONS = (
    click.option("--start", metavar="X,Y,Z,A,B,C", help="Pose before the program in machine coordinates [mm, deg]."),
    click.option("--angles", metavar="A,B,C", help="Angles at which a program of three axes runs [deg]."),
    click.option(
        "--offset",
        "offsets",
        multiple=True,
        metavar="G54=X,Y,Z",
        help="Work offset in the control [mm], G54 to G59.3 or G92; place of G28 or G30. A, B, C may follow [default: zero].",
    ),
    click.option("--parameters", type=_FILE, help="LinuxCNC's parameter file, for offsets and places not given."),
    click.option(
        "--tool-length",
        "lengths",
        multiple=True,
        metavar="TOOL=MM",
        help="Length of a tool in the control, for G43 [mm].",
    ),
    click.option("--tools", type=_FILE, help="LinuxCNC's tool table, for lengths not given."),
)


def control_options(function: _Function) -> _Function:
    """Give a command `start`, `angles`, `offsets`, `parameters`, `lengths` and `tools`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def lengths_by_tool(texts: tuple[str, ...]) -> dict[int, float]:
    """Return lengths by number of the tool [mm] of each `TOOL=MM`."""
    found = {}
    for name, (length,) in named_numbers(texts, {1}, "--tool-length").items():
        number = name.lstrip("TH")
        if not number.isdecimal():
            raise click.BadParameter(f"{name!r} is no number of a tool", param_hint="--tool-length")
        found[int(number)] = length
    return found
