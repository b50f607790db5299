"""In which order the tests of a plan are measured."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.files.formats.plan import InlinePlan


class Order(StrEnum):
    """The order; the text is how it is called."""

    PLAN = "as the plan has them"
    HOLDER = "by holder, then by ball: each is put up once"


def ordered(plan: InlinePlan, order: Order, *, gate: bool = False) -> InlinePlan:
    """Return the plan with its tests in an order.

    Args:
        plan: as its file has it.
        order: holders and balls come in the order in which the plan names them first.
        gate: repeat the first test at the end, so that drift shows; a plan that names tests to repeat keeps its own.
    """
    tests = list(plan.plan.tests)
    if order is Order.HOLDER:
        holder_of = {test.ball: plan.plan.balls[test.ball].holder for test in tests}
        holders, balls = list(dict.fromkeys(holder_of.values())), list(holder_of)
        tests.sort(key=lambda test: (holders.index(holder_of[test.ball]), balls.index(test.ball)))
    again = plan.plan.repeat_at_end or ((tests[0].name,) if gate else ())
    return replace(plan, plan=plan.plan.model_copy(update={"tests": tuple(tests), "repeat_at_end": again}))
