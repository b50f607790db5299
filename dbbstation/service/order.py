"""The order of a plan's tests, and repeats at its end."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.plan.order import against_drift, by_holder

if TYPE_CHECKING:
    from dbbstation.files.formats.plan import InlinePlan


class Order(StrEnum):
    """The order."""

    PLAN = "plan"
    """As the plan has the tests."""
    HOLDER = "holder"
    """By holder and ball, each put up once."""
    DRIFT = "drift"
    """Mixed heights, so that a drift does not look like an effect of height."""


class Gate(StrEnum):
    """Tests repeated at the end, which show the drift."""

    PLAN = "plan"
    """The tests that the plan names in `repeat_at_end`."""
    FIRST = "first"
    """The first test."""
    HOLDERS = "holders"
    """The first test of each holder."""


def ordered(plan: InlinePlan, order: Order, gate: Gate = Gate.PLAN) -> InlinePlan:
    """Return the plan with ordered tests."""
    domain = plan.to_domain()
    choose = {Order.PLAN: lambda one: tuple(one.tests), Order.HOLDER: by_holder, Order.DRIFT: against_drift}
    names = choose[order](domain)
    tests = {test.name: test for test in plan.plan.tests}
    first_of: dict[str, str] = {}
    for name in names:
        first_of.setdefault(domain.tests[name].ball.holder, name)
    gates = {Gate.PLAN: (), Gate.FIRST: names[:1], Gate.HOLDERS: tuple(first_of.values())}
    again = plan.plan.repeat_at_end or gates[gate]
    changed = {"tests": tuple(tests[name] for name in names), "repeat_at_end": again}
    return replace(plan, plan=plan.plan.model_copy(update=changed))


def with_loss(plan: InlinePlan, percent: float | None, *, over_plan: bool) -> InlinePlan:
    """Return the plan with a limit of lost samples, if it states none or `over_plan`."""
    if percent is None or (plan.plan.largest_loss_percent is not None and not over_plan):
        return plan
    return replace(plan, plan=plan.plan.model_copy(update={"largest_loss_percent": percent}))
