"""`--largest-loss-percent`, for commands that record runs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import from_settings, shop_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.formats.plan import InlinePlan

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def loss_option(function: _Function) -> _Function:
    """Give a command `largest_loss_percent`, for `with_loss_limit`."""
    return shop_option(
        "--largest-loss-percent",
        setting="limits.largest_loss_percent",
        type=Finite(0.0, 100.0),
        help="A run that lost more of its samples is repeated [%]  [default: the plan's, else 0.5].",
    )(function)


def with_loss_limit(plan: InlinePlan, percent: float | None) -> InlinePlan:
    """Return the plan with the limit, for later judgements.

    The command line overrides the plan, which overrides the shop's settings.
    """
    stated = plan.plan.largest_loss_percent is not None
    if percent is None or (stated and from_settings("largest_loss_percent")):
        return plan
    return replace(plan, plan=plan.plan.model_copy(update={"largest_loss_percent": percent}))
