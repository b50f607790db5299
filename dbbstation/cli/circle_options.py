"""Options of circle programs, for `program` and `check`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.nc.circle_program import Approach

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_OPTIONS = (
    shop_option(
        "--step-deg",
        setting="program.step_deg",
        type=Finite(0.01, 5.0),
        default=0.1,
        show_default=True,
        help="Angle between points [deg].",
    ),
    shop_option(
        "--clearance-mm",
        setting="program.clearance_mm",
        type=Finite(0.0),
        default=20.0,
        show_default=True,
        help="Height of rapid moves above the first point [mm].",
    ),
    click.option("--bar-stays-on", is_flag=True, help="Start and end with the bar on its balls: no rapids, no stops."),
)


def circle_options(function: _Function) -> _Function:
    """Give a command `step_deg`, `clearance_mm` and `bar_stays_on`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def approach_of(clearance_mm: float, *, bar_stays_on: bool) -> Approach | None:
    """Return the approach to the first point."""
    from dbbstation.nc.circle_program import Approach

    return None if bar_stays_on else Approach(clearance_mm)
