"""Check that a bar's length and stroke suit the plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.plan.circle import USUAL_STROKE_MM

if TYPE_CHECKING:
    from dbbstation.plan.plan import Plan


def unlike_bar(length_mm: float, stroke_mm: float | None, plan: Plan) -> tuple[str, str] | None:
    """Return fault and remedy if tests need another bar, or None.

    Args:
        stroke_mm: travel of the gauge either way; None if not known.
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
