"""Positions of a plan's tests for SVG."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dbbstation.plan.plan import PlannedTest

WIDTH = 420
"""Width and height of the map in drawing units."""

_MARGIN = 70.0

_SAME_MM = 1.0
"""Largest distance of balls at one position, such as holders of several heights in one bore."""


def plate_map(tests: Mapping[str, PlannedTest], marked: Collection[str]) -> tuple[Mapping[str, object], ...]:
    """Return places of tests; +X is right, +Y up."""
    at: dict[tuple[int, int], list[PlannedTest]] = {}
    for test in tests.values():
        x, y, _ = test.ball.centre_mm
        at.setdefault((round(x / _SAME_MM), round(y / _SAME_MM)), []).append(test)
    xs, ys = [x for x, _ in at], [y for _, y in at]
    width_mm = max(max(xs) - min(xs), max(ys) - min(ys), 1) * _SAME_MM
    scale = (WIDTH - 2.0 * _MARGIN) / width_mm
    middle = _SAME_MM * (max(xs) + min(xs)) / 2.0, _SAME_MM * (max(ys) + min(ys)) / 2.0
    return tuple(
        {
            "x": round(WIDTH / 2.0 + scale * (_SAME_MM * x - middle[0]), 1),
            "y": round(WIDTH / 2.0 - scale * (_SAME_MM * y - middle[1]), 1),
            "label": _label(there),
            "tests": " ".join(test.name for test in there),
            "marked": any(test.name in marked for test in there),
        }
        for (x, y), there in at.items()
    )


def _label(there: list[PlannedTest]) -> str:
    bores = list(dict.fromkeys(test.ball.bore for test in there if test.ball.bore is not None))
    if bores:
        return f"bore {', '.join(map(str, bores))}"
    x, y, _ = there[0].ball.centre_mm
    return f"X {x:.0f} Y {y:.0f}"
