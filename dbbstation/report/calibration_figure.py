"""Figure of a calibration."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle as Ring

from dbbstation.calibration.checks.scatter import fine_noise_mm
from dbbstation.calibration.checks.visibility import visibility
from dbbstation.calibration.reporting.residual_map import ball_shifts, circle_tests, residual_map
from dbbstation.computing.arrays import hypot_of, largest_size
from dbbstation.report.drawing import (
    AFTER,
    BEFORE,
    DIRECTIONS,
    LINE_OF_DIRECTION,
    ROW_IN,
    SET,
    WIDTH_IN,
    ShownFigure,
    draw_maps,
    heading,
    in_style,
    labelled,
    legend_above,
)
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.report.polar import step_of
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.reporting.residual_map import BallShift, CircleTest

COLUMNS = 5
"""Number of circles side by side."""

LONGEST_MM = 60.0
"""Length of the longest arrow [mm of the plate]."""


def calibration_figure(calibration: Calibration, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw the figure as SVG."""
    with in_style():
        if isinstance(wanted, OnePanel):
            tests = circle_tests(calibration)
            reach = max(largest_size(circle.before_um) for test in tests for circle in test.circles)
            panels = {test.name: partial(_circle, test=test, ring=step_of(reach / 2.0)) for test in tests}
            centres = {"centres": partial(_centres, tests=tests, k=1, title="calibrated")}
            return wanted.draw(centres | {"balls": partial(_balls, balls=ball_shifts(calibration))} | panels)
        return in_format(draw_calibration(calibration), wanted)


def draw_calibration(calibration: Calibration) -> ShownFigure:
    """Draw all parts, one below the other."""
    tests = circle_tests(calibration)
    rows = -(-len(tests) // COLUMNS)
    heights = [2.3 * rows + 0.3, 1.2 + ROW_IN * len(tests), 4.3]
    figure = ShownFigure(figsize=(WIDTH_IN, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=heights, hspace=0.03)
    _circles(parts[0], tests, rows)
    _left_and_leverage(parts[1], calibration)
    plate: Any = parts[2].subplots(1, 3)
    for axes, k, title in zip(plate, (0, 1), ("nominal machine", "calibrated"), strict=False):
        _centres(axes, tests, k, title)
    _balls(plate[2], ball_shifts(calibration))
    return figure


def _circles(part: SubFigure, tests: Sequence[CircleTest], rows: int) -> None:
    reach = max(largest_size(circle.before_um) for test in tests for circle in test.circles)
    ring = step_of(reach / 2.0)
    heading(part, f"measured less predicted length about the commanded circle, one ring {ring:g} µm")
    panels: Any = part.subplots(rows, min(COLUMNS, len(tests)), squeeze=False)
    for axes, test in zip(panels.flat, tests, strict=False):
        _circle(axes, test, ring)
    for axes in panels.flat:
        axes.set_axis_off()
    sides = {"nominal machine": BEFORE, "calibrated": AFTER}
    legend_above(part, panels[0, 0], {k: {"color": c, "linewidth": 1.0} for k, c in sides.items()} | DIRECTIONS)


def _circle(axes: Axes, test: CircleTest, ring: float) -> None:
    zero = 4.0 * ring
    for k in range(1, 7):
        style: Any = {"color": "black", "linewidth": 0.7} if k == 4 else {"color": "#cccccc", "linewidth": 0.4}  # noqa: PLR2004
        axes.add_patch(Ring((0.0, 0.0), k * ring, fill=False, **style))
    for circle in test.circles:
        theta = np.radians(np.append(circle.theta_deg, circle.theta_deg[0]))
        for values, colour in ((circle.before_um, BEFORE), (circle.after_um, AFTER)):
            radius = zero + np.append(values, values[0])
            line = LINE_OF_DIRECTION[circle.direction]
            axes.plot(radius * np.cos(theta), radius * np.sin(theta), color=colour, linewidth=0.9, linestyle=line)
    axes.text(6.3 * ring, 0.0, "+X", fontsize=7, va="center")
    axes.text(0.0, 6.5 * ring, "+Y", fontsize=7, ha="center")
    axes.set_xlim(-7.2 * ring, 7.2 * ring)
    axes.set_ylim(-6.2 * ring, 7.6 * ring)
    axes.set_aspect("equal")
    before, after = test.circularity_um
    axes.set_title(f"{test.name}: circularity {before:.0f} → {after:.1f} µm")


def _left_and_leverage(part: SubFigure, calibration: Calibration) -> None:
    panels: Any = part.subplots(1, 3, width_ratios=(1.0, 1.0, 0.9))
    left = residual_map(calibration.observations, calibration.residual_mm)
    mesh = draw_maps(panels[:2], ["left within mountings"], [left], 1e3 * fine_noise_mm(calibration))
    part.colorbar(mesh, ax=list(panels[:2]), label="measured less model, µm", pad=0.01)
    _leverage(panels[2], visibility(calibration).leverage)


def _leverage(axes: Axes, leverage: Mapping[str, float]) -> None:
    place = np.arange(len(leverage))
    axes.barh(place, list(leverage.values()), color="#777777")
    axes.set_yticks(place, list(leverage))
    axes.set_ylim(len(leverage) - 0.5, -0.5)
    labelled(axes, "parameters' worth of what is known", "test", "leverage of each test")


def _centres(axes: Axes, tests: Sequence[CircleTest], k: int, title: str) -> None:
    where = np.array([test.ball_mm for test in tests])
    shift = np.array([test.centre_um[k] for test in tests])
    longest = float(np.hypot(*shift.T).max()) or 1.0
    per_mm = longest / LONGEST_MM
    scale: Any = {"angles": "xy", "scale_units": "xy", "scale": per_mm, "width": 0.006}
    levels = sorted({round(float(z)) for z in where[:, 2]})
    for test, ball, arrow in zip(tests, where, shift, strict=True):
        colour = SET[levels.index(round(float(ball[2]))) % len(SET)]
        axes.plot(*ball[:2], "o", color="#999999", markersize=4.0, zorder=1)
        axes.quiver(*ball[:2], *arrow, color=colour, zorder=2, **scale)
        tip = ball[:2] + arrow / per_mm + 7.0 * arrow / max(hypot_of(*arrow), 1e-12)
        axes.text(tip[0], tip[1], test.name, color=colour, ha="center", va="center", fontsize=8)
    middle, half = (where.min(axis=0) + where.max(axis=0)) / 2.0, np.ptp(where, axis=0).max() / 2.0 + LONGEST_MM + 20.0
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + 1.15 * half)
    axes.set_aspect("equal")
    labelled(axes, "X, mm", "Y, mm", f"centres off the balls, {title}")
    key, start = step_of(longest), middle[:2] - half + np.array([8.0, 10.0])
    axes.quiver(*start, key, 0.0, color="black", **scale)
    axes.text(start[0], start[1] + 5.0, f"{key:g} µm", fontsize=8, va="bottom")
    for colour, z in zip(SET, levels, strict=False):
        axes.plot([], [], color=colour, linewidth=2.0, label=f"Z {z:g} mm")
    axes.legend(loc="upper center", handlelength=1.0, borderpad=0.1, ncols=3, columnspacing=1.0)


def _balls(axes: Axes, balls: Sequence[BallShift]) -> None:
    axes.set_title("balls off their stated places, bars ±2σ")
    if not balls:
        axes.text(0.5, 0.5, "no ball of known place", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    sizes = sorted({round(ball.stated_um, 2) for ball in balls})
    for ball in balls:
        colour = SET[sizes.index(round(ball.stated_um, 2)) % len(SET)]
        (x, y), (dx, dy) = ball.shift_um, 2.0 * ball.sigma_um
        axes.errorbar(x, y, dy, dx, color=colour, marker="o", markersize=3.0, linewidth=0.0, elinewidth=0.5)
        axes.annotate(" ".join(ball.tests), (x, y), (3, 3), textcoords="offset points", fontsize=8, color=colour)
    for colour, size in zip(SET, sizes, strict=False):
        axes.add_patch(Ring((0.0, 0.0), 2.0 * size, fill=False, color=colour, linewidth=0.9))
        axes.plot([], [], color=colour, linewidth=0.9, label=f"2 × {size:g} µm stated")
    reach = 1.1 * max(2.0 * sizes[-1], *(float(np.max(np.abs(b.shift_um) + 2.0 * b.sigma_um)) for b in balls))
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, 1.25 * reach)
    axes.set_aspect("equal")
    labelled(axes, "X, µm", "Y, µm")
    axes.legend(loc="upper right", handlelength=1.0, borderpad=0.1)
