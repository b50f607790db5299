"""Options that say what a session notes beside its runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.recordings.entries import Bar
    from dbbstation.files.recordings.session_text import SessionDetails

_Function = TypeVar("_Function", bound="Callable[..., Any]")

_OPTIONS = (
    click.option("--operator", default="", help="Name of the operator."),
    shop_option("--serial-number", setting="serial_number", default="", help="Serial number of the machine."),
    click.option("--ambient-temp-c", type=Finite(), help="Temperature of the shop [degC]."),
    shop_option("--bar-serial-number", setting="bar.serial_number", default="", help="Serial number of the bar."),
    shop_option(
        "--bar-length-mm",
        setting="bar.calibrated_length_mm",
        type=Finite(),
        help="Calibrated distance between the ball centres [mm]; held against the plan's radii, never added to readings.",
    ),
    shop_option(
        "--bar-uncertainty-um",
        setting="bar.calibrator_uncertainty_mm",
        factor=1e3,
        type=Finite(),
        help="Standard uncertainty u of that length [µm].",
    ),
    shop_option(
        "--bar-temp-c", setting="bar.temp_c", type=Finite(), help="Temperature of the bar at its calibration [degC]."
    ),
)


def session_options(function: _Function) -> _Function:
    """Give a command these options; it takes them as keywords and passes them to `session_details`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def session_details(
    *,
    operator: str,
    serial_number: str,
    ambient_temp_c: float | None,
    bar_serial_number: str,
    bar_length_mm: float | None,
    bar_uncertainty_um: float | None,
    bar_temp_c: float | None,
    stroke_mm: float | None,
) -> SessionDetails:
    """Return what was told of machine, shop and bar, with the stroke that the instrument file states [mm].

    Raises:
        click.UsageError: length without uncertainty, or something of the bar without either.
    """
    from dbbstation.files.recordings.session_text import SessionDetails

    bar = _bar(bar_serial_number, bar_length_mm, bar_uncertainty_um, bar_temp_c, stroke_mm)
    return SessionDetails(serial_number, operator, ambient_temp_c, bar)


def _bar(
    serial_number: str,
    length_mm: float | None,
    uncertainty_um: float | None,
    temp_c: float | None,
    stroke_mm: float | None,
) -> Bar | None:
    from dbbstation.files.recordings.entries import Bar

    if length_mm is None and uncertainty_um is None:
        if serial_number or temp_c is not None:
            raise click.UsageError("a bar needs --bar-length-mm and --bar-uncertainty-um")
        return None
    if length_mm is None or uncertainty_um is None:
        raise click.UsageError("--bar-length-mm and --bar-uncertainty-um belong together")
    return Bar(serial_number, length_mm, uncertainty_um / 1e3, None, temp_c, None, stroke_mm)
