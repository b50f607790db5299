"""Options on the order of tests and on NC programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.formats.plan import InlinePlan

_Function = TypeVar("_Function", bound="Callable[..., Any]")

# The values of `Order` and `Gate`; a test holds them together, so that no command waits for what those import.
ORDERS, GATES = ("plan", "holder", "drift"), ("plan", "first", "holders")

_ORDER = click.option(
    "--order",
    type=click.Choice(ORDERS),
    default="plan",
    show_default=True,
    help="As the plan has its tests; by holder and ball, each put up once; or heights in turn, apart from drift.",
)
_GATE = click.option(
    "--gate",
    type=click.Choice(GATES),
    default="plan",
    show_default=True,
    help="Test repeated at the end to show drift, if the plan names none: the first one, or the first of each holder.",
)


programs_option = click.option(
    "--programs", type=click.Path(path_type=Path, file_okay=False), help="Folder of TEST-DIRECTION programs."
)
"""The NC programs that command the runs; without it they are plain nominal circles."""


def order_options(function: _Function) -> _Function:
    """Give a command `--order` and `--gate`."""
    return _ORDER(_GATE(function))


def in_order(plan: InlinePlan, order: str, gate: str) -> InlinePlan:
    """Return the ordered plan."""
    from dbbstation.service.order import Gate, Order, ordered

    return ordered(plan, Order(order), Gate(gate))
