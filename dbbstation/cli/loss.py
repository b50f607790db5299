"""`--largest-loss-percent`: for every command that records runs."""

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
    """Give a command the option; it takes `largest_loss_percent` and passes it to `with_loss_limit`."""
    return shop_option(
        "--largest-loss-percent",
        setting="limits.largest_loss_percent",
        type=Finite(0.0, 100.0),
        help="A run that lost more of its samples is repeated [%]  [default: what the plan says, or 0.5].",
    )(function)


def with_loss_limit(plan: InlinePlan, percent: float | None) -> InlinePlan:
    """Return the plan with the limit in it, so that whoever reads the session later holds its runs against the same.

    The command line holds over the plan, and the plan over the shop's settings.
    """
    stated = plan.plan.largest_loss_percent is not None
    if percent is None or (stated and from_settings("largest_loss_percent")):
        return plan
    return replace(plan, plan=plan.plan.model_copy(update={"largest_loss_percent": percent}))
