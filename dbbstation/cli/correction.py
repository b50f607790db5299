"""`--largest-correction-mm`, for commands that write compensated programs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option
from dbbstation.nc.limits import LARGEST_ALLOWED_MM, LARGEST_CORRECTION_MM

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def largest_correction_option(function: _Function) -> _Function:
    """Give a command `largest_mm` [mm]."""
    return shop_option(
        "--largest-correction-mm",
        "largest_mm",
        setting="limits.largest_correction_mm",
        type=Finite(0.0, LARGEST_ALLOWED_MM, min_open=True),
        default=LARGEST_CORRECTION_MM,
        show_default=True,
        help="Refuse a model that shifts any point by more [mm].",
    )(function)
