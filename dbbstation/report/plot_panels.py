"""Panels of a test, and the map of centres."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from matplotlib.patches import Circle as Ring

from dbbstation.circles.estimates import FIRST
from dbbstation.computing.arrays import hypot_of, largest_size
from dbbstation.computing.grouped import grouped
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.plan.plan import Direction
from dbbstation.report.drawing import AFTER, BEFORE, QUARTERS, SET
from dbbstation.report.polar import CIRCLE, REACH, SIZE, step_of, thinned
from dbbstation.report.sheet import TEXT_PT, Box, line_in, place_labels, width_of_in, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.plan.plan import PlannedTest
    from dbbstation.report.drawing import LineStyle
    from dbbstation.report.sheet import Sheet
    from dbbstation.results.circles import MeasuredCircle


Drawn: TypeAlias = "tuple[MeasuredCircle, bool]"
"""A run, and whether its line is thin."""

SMALL_PT = 7.0

CAPTION_IN = line_in(TEXT_PT) + line_in(SMALL_PT)
"""Height of a panel's two lines [inch]."""

_SIDE_IN, _FOOT_IN = 0.55, 0.42
"""Margins for the numbers of the axes, at the left and below [inch]."""


def draw_polar(sheet: Sheet, box: Box, name: str, drawn: Sequence[Drawn], reach_um: float | None = None) -> None:
    """Draw traces about least-squares circles; rings are a division apart.

    Args:
        reach_um: largest drawn deviation; None: the greatest.
    """
    found = [(one.analysed, thin) for one, thin in drawn]
    most_um = reach_um or max(largest_size(analysis.residual_um) for analysis, _ in found)
    scale, step_um = REACH / max(most_um, 1e-3), step_of(most_um)
    lines = [name, f"G {_figures(drawn)} µm; one division {step_um:g} µm"]
    top = _caption(sheet, box, lines)
    side = min(box.width, top - box.bottom)
    axes = sheet.axes(Box(box.left + 0.5 * (box.width - side), top - side, side, side))
    axes.set_axis_off()
    half = SIZE / 2.0
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    ends = (14 - half, half - 14)
    for line in ((ends, (0, 0)), ((0, 0), ends)):
        axes.plot(*line, color="#c4c4c4", linewidth=0.5)
    divisions = (-step_um, 0.0, step_um)
    for um in divisions:
        style: Any = {"color": "#c4c4c4", "linewidth": 0.5} if um else {"color": "#555555", "linewidth": 0.7}
        axes.add_patch(Ring((0.0, 0.0), CIRCLE + scale * um, fill=False, **style))
    for analysis, thin in found:
        closed = (np.append(line, line[0]) for line in thinned(analysis.path.theta_deg, analysis.residual_um))
        theta, radius = np.radians(next(closed)), CIRCLE + scale * next(closed)
        axes.plot(radius * np.cos(theta), radius * np.sin(theta), **_style(analysis, thin=thin))
    units_per_in = SIZE / side
    _written(axes, half - 14, 0.07 * units_per_in, "X", ha="right")
    _written(axes, 0.1 * units_per_in, half - 14 - 0.05 * units_per_in, "Y", ha="left")
    for um in divisions:
        label = f"{um:+g}" if um else "0"
        # Below the path, to the right of the axis: the letters of the axes stand elsewhere.
        _written(axes, 0.05 * units_per_in, -CIRCLE - scale * um, label, ha="left")


def draw_deviation(sheet: Sheet, box: Box, name: str, drawn: Sequence[Drawn]) -> None:
    """Draw traces over the angle from +X towards +Y."""
    axes = _chart(sheet, box, [name, f"G {_figures(drawn)} µm"], "deviation, µm")
    for one, thin in drawn:
        turn = one.analysed
        axes.plot(*thinned(turn.path.theta_deg, turn.residual_um), **_style(turn, thin=thin))
    _turn(axes)


def draw_together(sheet: Sheet, box: Box, name: str, runs: Mapping[str, Sequence[MeasuredCircle]]) -> None:
    """Draw the runs of several sessions over the angle, one colour per session."""
    axes = _chart(sheet, box, [name], "deviation, µm")
    for colour, (session, of) in zip(_colours(len(runs)), runs.items(), strict=True):
        for k, one in enumerate(of):
            style = _style(one.analysed, thin=False) | {"color": colour}
            line = thinned(one.analysed.path.theta_deg, one.analysed.residual_um)
            axes.plot(*line, **style, label=session if k == 0 else None)
    _turn(axes)
    # Above the lines, which get room for it.
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.22 * (high - low))
    legend = axes.legend(loc="upper right", ncols=min(len(runs), 4), borderpad=0.1, handlelength=1.5)
    for text in legend.get_texts():
        text.set_parse_math(False)
        text.set_text(wrapped(text.get_text(), TEXT_PT, 1.6, 1)[0])


def draw_spectrum(sheet: Sheet, box: Box, name: str, drawn: Sequence[Drawn]) -> None:
    """Draw the amplitudes of undulations, and the noise."""
    spectra = [(one.analysed, one.spectrum, thin) for one, thin in drawn]
    noise = [each.noise_um for _, each, _ in spectra if np.isfinite(each.noise_um)]
    noise_um = sqrt(np.mean(np.square(noise))) if noise else 0.0
    subtitle = f"noise alone {noise_um:.2g} µm, dotted" if noise else "noise not known: too few samples"
    axes = _chart(sheet, box, [name, subtitle], "amplitude, µm")
    least = 1e-4  # a tenth of what bars resolve; zero has no place on this scale
    for analysis, each, thin in spectra:
        style = _style(analysis, thin=thin) | {"marker": "." if not thin else "", "markersize": 3.0}
        axes.plot(each.undulations, np.maximum(each.amplitude_um, least), **style)
    if noise:
        axes.axhline(max(noise_um, least), color="#555555", linewidth=0.9, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    highest = max((int(each.undulations[-1]) for _, each, _ in spectra if len(each.undulations)), default=FIRST)
    axes.set_xlim(FIRST / 1.1, 1.1 * max(highest, FIRST + 1))
    ticks = [k for k in (2, 3, 4, 6, 10, 20, 30, 60) if k <= max(highest, FIRST + 1)]
    axes.set_xticks(ticks, [str(k) for k in ticks])
    axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_yticks([], minor=True)
    axes.set_xlabel("undulations per revolution", fontsize=SMALL_PT, labelpad=1.0)


def _chart(sheet: Sheet, box: Box, lines: Sequence[str], unit: str) -> Axes:
    top = _caption(sheet, box, lines)
    axes = sheet.axes(
        Box(box.left + _SIDE_IN, box.bottom + _FOOT_IN, box.width - _SIDE_IN - 0.12, top - box.bottom - _FOOT_IN - 0.05)
    )
    axes.tick_params(labelsize=SMALL_PT)
    axes.set_ylabel(unit, fontsize=SMALL_PT, labelpad=1.0)
    axes.grid(color="#e0e0e0", linewidth=0.5)
    axes.set_axisbelow(True)
    return axes


def _turn(axes: Axes) -> None:
    axes.set_xlim(0.0, FULL_TURN_DEG)
    axes.set_xticks(QUARTERS)
    axes.set_xlabel("angle from +X to +Y, °", fontsize=SMALL_PT, labelpad=1.0)


def _caption(sheet: Sheet, box: Box, lines: Sequence[str]) -> float:
    y = box.bottom + box.height
    for k, line in enumerate(lines):
        size = SMALL_PT if k else TEXT_PT
        (text,) = wrapped(line, size, box.width, 1)
        sheet.text(box.left, y, text, size)
        y -= line_in(size)
    return y


def _figures(drawn: Sequence[Drawn]) -> str:
    last = (one for one, thin in drawn if not thin)
    return ", ".join(f"{one.budget().value_um:.1f} {str(one.entry.direction).upper()}" for one in last)


def _style(analysis: CircleAnalysis, *, thin: bool) -> LineStyle:
    ccw = analysis.raw.circle.direction is Direction.CCW
    return {
        "color": AFTER if ccw else BEFORE,
        "linestyle": "-" if ccw else "--",
        "linewidth": 0.35 if thin else 1.0,
        "alpha": 0.7 if thin else 1.0,
        "solid_joinstyle": "round",
    }


def _colours(count: int) -> list[str]:
    free = [colour for colour in SET if colour not in {AFTER, BEFORE}]
    return [free[k % len(free)] for k in range(count)]


def _written(axes: Axes, x: float, y: float, text: str, ha: str) -> None:
    box: Any = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.75}
    axes.text(x, y, text, fontsize=6.0, ha=ha, va="center", bbox=box, parse_math=False)


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
    labels = [f"{test}: {hypot_of(*um):.1f} µm" for test, um in centres_um.items()]
    sizes = [(width_of_in(label, TEXT_PT) + 0.04, line_in(TEXT_PT)) for label in labels]
    keep_off = [_around(place, _BALL_IN) for place in at]
    keep_off += [_around(place + along, _BALL_IN) for place, along in zip(at, arrows, strict=True)]
    keep_off.append(Box(area.left, area.bottom, LONGEST_IN + 0.3, 0.3))
    for ball, label, put in zip(at, labels, place_labels([tuple(p) for p in at], sizes, area, keep_off), strict=True):
        if put is None:
            continue
        middle = np.array([put.left + 0.5 * put.width, put.bottom + 0.5 * put.height])
        if hypot_of(*(middle - ball)) > _FAR_IN + 0.5 * put.width:
            axes.plot(*np.array([ball, middle]).T, color="#999999", linewidth=0.4, zorder=0)
        axes.text(middle[0], middle[1], label, ha="center", va="center", fontsize=TEXT_PT, parse_math=False)


def _arrow(axes: Axes, tail: np.ndarray, along: np.ndarray, colour: str) -> None:
    style = {
        "arrowstyle": "-|>",
        "color": colour,
        "linewidth": 1.2,
        "shrinkA": 0.0,
        "shrinkB": 0.0,
        "mutation_scale": 6,
    }
    axes.annotate("", xy=tuple(tail + along), xytext=tuple(tail), arrowprops=style)


def _centres_um(circles: Sequence[MeasuredCircle]) -> dict[str, np.ndarray]:
    by_test = grouped((one.entry.test, one.analysed.centre_mm) for one in circles)
    return {test: 1e3 * np.mean(of, axis=0) for test, of in by_test.items()}


def _places(area: Box, balls_mm: np.ndarray) -> np.ndarray:
    middle_mm = 0.5 * (balls_mm.min(axis=0) + balls_mm.max(axis=0))
    spread_mm = max(float(np.ptp(balls_mm, axis=0).max()), 1.0)
    scale = (min(area.width, area.height) - 2.0 * _ROOM_IN) / spread_mm
    middle_in = np.array([area.left + 0.5 * area.width, area.bottom + 0.5 * area.height])
    return np.asarray(middle_in + scale * (balls_mm - middle_mm))


def _around(place: np.ndarray, half: float) -> Box:
    x, y = place
    return Box(x - half, y - half, 2.0 * half, 2.0 * half)
