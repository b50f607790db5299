"""Centres of circles as arrows from balls, with separate labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.report.drawing import AFTER
from dbbstation.report.polar import step_of
from dbbstation.report.sheet import TEXT_PT, Box, line_in, place_labels, width_of_in, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from dbbstation.plan.plan import PlannedTest
    from dbbstation.report.sheet import Sheet
    from dbbstation.results.circles import MeasuredCircle

LONGEST_IN = 0.6
"""The longest arrow [inch]."""

_ROOM_IN = 0.9
"""Distance of the outermost balls from the edge: space for an arrow and a label [inch]."""

_BALL_IN = 0.05
_FAR_IN = 0.25
"""A line connects a label to its ball if their distance is greater [inch]."""


def draw_map(
    sheet: Sheet, box: Box, name: str, tests: Mapping[str, PlannedTest], circles: Sequence[MeasuredCircle]
) -> None:
    """Draw balls and mean circle centres; +X is right, +Y up."""
    centres_um = _centres_um(circles)
    balls_mm = np.array([tests[test].ball.centre_mm[:2] for test in centres_um])
    shift_um = np.array(list(centres_um.values()))
    longest_um = max(float(np.hypot(*shift_um.T).max()), 1e-3)
    key_um = step_of(longest_um)
    known = all(tests[test].ball.place_known for test in centres_um)
    told = "" if known else "; balls under the spindle: their centres say nothing of the place"
    caption = [*([name] if name else []), f"the arrow at the lower left is {key_um:g} µm{told}"]
    top = box.bottom + box.height
    for line in caption:
        sheet.text(box.left, top, wrapped(line, TEXT_PT, box.width, 1)[0])
        top -= line_in(TEXT_PT)
    area = Box(box.left, box.bottom, box.width, top - box.bottom - 0.05)
    at, arrows = _places(area, balls_mm), LONGEST_IN / longest_um * shift_um
    key_at = np.array([area.left + 0.15, area.bottom + 0.15])
    axes = sheet.axes(area)
    axes.set_xlim(area.left, area.left + area.width)
    axes.set_ylim(area.bottom, area.bottom + area.height)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#c4c4c4")
    for ball, along in zip(at, arrows, strict=True):
        axes.plot(*ball, "o", color="#555555", markersize=4.0)
        _arrow(axes, ball, along, AFTER)
    _arrow(axes, key_at, np.array([LONGEST_IN * key_um / longest_um, 0.0]), "black")
    labels = [f"{test}: {float(np.hypot(*um)):.1f} µm" for test, um in centres_um.items()]
    sizes = [(width_of_in(label, TEXT_PT) + 0.04, line_in(TEXT_PT)) for label in labels]
    keep_off = [_around(place, _BALL_IN) for place in at]
    keep_off += [_around(place + along, _BALL_IN) for place, along in zip(at, arrows, strict=True)]
    keep_off.append(Box(area.left, area.bottom, LONGEST_IN + 0.3, 0.3))
    for ball, label, put in zip(at, labels, place_labels([tuple(p) for p in at], sizes, area, keep_off), strict=True):
        if put is None:
            continue
        middle = np.array([put.left + 0.5 * put.width, put.bottom + 0.5 * put.height])
        if float(np.hypot(*(middle - ball))) > _FAR_IN + 0.5 * put.width:
            axes.plot(*np.array([ball, middle]).T, color="#999999", linewidth=0.4, zorder=0)
        axes.text(
            float(middle[0]), float(middle[1]), label, ha="center", va="center", fontsize=TEXT_PT, parse_math=False
        )


def _arrow(axes: Axes, tail: np.ndarray, along: np.ndarray, colour: str) -> None:
    (x, y), (tip_x, tip_y) = tail, tail + along
    style = {
        "arrowstyle": "-|>",
        "color": colour,
        "linewidth": 1.2,
        "shrinkA": 0.0,
        "shrinkB": 0.0,
        "mutation_scale": 6,
    }
    axes.annotate("", xy=(float(tip_x), float(tip_y)), xytext=(float(x), float(y)), arrowprops=style)


def _centres_um(circles: Sequence[MeasuredCircle]) -> dict[str, np.ndarray]:
    by_test: dict[str, list[tuple[float, float]]] = {}
    for one in circles:
        if one.analysis is not None:
            by_test.setdefault(one.entry.test, []).append(one.analysis.centre_mm)
    return {test: 1e3 * np.mean(of, axis=0) for test, of in by_test.items()}


def _places(area: Box, balls_mm: np.ndarray) -> np.ndarray:
    middle_mm = 0.5 * (balls_mm.min(axis=0) + balls_mm.max(axis=0))
    spread_mm = max(float(np.ptp(balls_mm, axis=0).max()), 1.0)
    scale = (min(area.width, area.height) - 2.0 * _ROOM_IN) / spread_mm
    middle_in = np.array([area.left + 0.5 * area.width, area.bottom + 0.5 * area.height])
    return np.asarray(middle_in + scale * (balls_mm - middle_mm))


def _around(place: np.ndarray, half: float) -> Box:
    return Box(float(place[0]) - half, float(place[1]) - half, 2.0 * half, 2.0 * half)
