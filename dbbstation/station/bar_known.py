"""Check that the bar's length is known well enough, because balls at known positions need an absolute length."""

from __future__ import annotations

from datetime import timedelta
from typing import TYPE_CHECKING

from dbbstation.errors import InputError

if TYPE_CHECKING:
    from datetime import datetime

    from dbbstation.plan.bar import Bar
    from dbbstation.plan.plan import Plan

USUAL_AGE_H = 24.0
"""Usual age beyond which a calibration is stale [h]. Every day a bar is carried and warmed by hands, and a display is
switched off and preset again. One day limits this to one time."""

_REMEDY = (
    "put it on its calibrator: `dbbstation bar`, then --bar FILE; or say with --bar-waiver TEXT why it is done without"
)


def check_bar_known(bar: Bar | None, plan: Plan, now: datetime, largest_age_h: float = USUAL_AGE_H) -> None:
    """Refuse a calibrator with an invalid certificate. For balls at known positions, also refuse an unknown or stale bar length.

    An error of the bar's length becomes an error of the machine's scale. Balls under the spindle, and circularity
    alone, need no length.

    Args:
        largest_age_h: beyond which a calibration is stale.

    Raises:
        InputError: what is wrong with the bar, and what to do.
    """
    places = any(test.ball.place_known for test in plan.tests.values())
    if bar is not None and (fault := bar.certificate_fault(now.date())):
        what = fault
    elif not places:
        return
    elif bar is None or bar.reading_mm is None or bar.calibrated is None:
        what = (
            "nobody has read the bar on its calibrator, and the plan has balls at known places, which need its length"
        )
    elif bar.calibrated > now + timedelta(minutes=10):
        what = f"the bar's calibration is of the future, {bar.calibrated:%Y-%m-%d %H:%M %Z}: a clock was wrong"
    elif (age_h := (now - bar.calibrated) / timedelta(hours=1)) > largest_age_h:
        what = f"the bar was last on its calibrator {age_h:.0f} h ago, {largest_age_h:g} h are allowed"
    else:
        return
    raise InputError.of("bar", what, _REMEDY)
