"""Whether the bar that was noted can be the one that ran the plan: its length, give or take its stroke."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.plan.circle import USUAL_STROKE_MM

if TYPE_CHECKING:
    from dbbstation.plan.plan import Plan


def unlike_bar(length_mm: float, stroke_mm: float | None, plan: Plan) -> tuple[str, str] | None:
    """Return what is wrong and what to do where tests of a plan need another bar; None where all can be run with this one.

    Args:
        length_mm: calibrated distance between the ball centres [mm].
        stroke_mm: travel of the gauge either way [mm]; None where not known.
        plan: whose tests state a bar length each.
    """
    stroke = USUAL_STROKE_MM if stroke_mm is None else stroke_mm
    out = {
        name: test.circle.bar_mm for name, test in plan.tests.items() if abs(test.circle.bar_mm - length_mm) > stroke
    }
    if not out:
        return None
    radii = ", ".join(f"{radius:g}" for radius in sorted(set(out.values())))
    names = ", ".join(list(out)[:_MOST_NAMED]) + (
        f" and {len(out) - _MOST_NAMED} more" if len(out) > _MOST_NAMED else ""
    )
    source = "" if stroke_mm is not None else ", as none is stated"
    what = (
        f"a bar of {length_mm:g} mm with a stroke of {stroke:g} mm either way{source} cannot run circles of radius_mm "
        f"{radii} (test {names})"
    )
    return what, "give the calibrated length of the bar that is used (it is held against the plan only), or its plan"


_MOST_NAMED = 4
