"""Figure of a comparison of sessions."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.computing.arrays import sum_of
from dbbstation.plan.plan import Direction
from dbbstation.report.drawing import (
    AFTER,
    BEFORE,
    QUARTERS,
    ShownFigure,
    in_style,
    labelled,
    map_by_angle,
    zero_line,
)
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh

    from dbbstation.diagnosis.compare.comparison import Comparison
    from dbbstation.diagnosis.compare.findings import RunDifference

OVERLAYS = 3
COLOUR_A, COLOUR_B = AFTER, BEFORE


def compare_figure(found: Comparison, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw maps over test and angle, and the worst runs of three tests, as SVG."""
    tests = list(dict.fromkeys((run.test, run.number) for run in found.runs))
    with in_style():
        reach = max(abs(run.peak_um) for run in found.runs) or 1.0
        if isinstance(wanted, OnePanel):
            draw = partial(_map, found=found, tests=tests, reach=reach)
            return wanted.draw({str(direction): partial(draw, direction=direction) for direction in Direction})
        figure = ShownFigure(figsize=(11.0, 6.0 + 0.2 * len(tests)), layout="constrained")
        halves: Any = figure.subfigures(2, 1, height_ratios=(1.2 + 0.2 * len(tests), 4.2))
        upper, lower = halves
        maps: Any = upper.subplots(1, 2, sharey=True)
        drawn = [_map(axes, found, tests, direction, reach) for axes, direction in zip(maps, Direction, strict=True)]
        upper.colorbar(drawn[0], ax=maps, label="B less A, µm")
        worst = _worst(found)
        lines: Any = lower.subplots(2, len(worst), sharex=True, squeeze=False)
        for k, run in enumerate(worst):
            _overlay(lines[0, k], lines[1, k], run)
        lines[0, 0].set_ylabel("length less commanded, µm")
        lines[1, 0].set_ylabel("B less A, µm")
        return in_format(figure, wanted)


def _worst(found: Comparison) -> list[RunDifference]:
    by_test: dict[str, RunDifference] = {}
    for run in sorted(found.runs, key=lambda run: (-sum_of(run.found_mm**2), -run.rms_um)):
        by_test.setdefault(run.test, run)
    return list(by_test.values())[:OVERLAYS]


def _map(axes: Axes, found: Comparison, tests: list[tuple[str, int]], direction: Direction, reach: float) -> QuadMesh:
    rows = {(r.test, r.number): r.by_angle_um for r in found.runs if r.direction == direction}
    nothing = np.full(len(found.runs[0].by_angle_um), np.nan)
    values = np.array([rows.get(test, nothing) for test in tests])
    numbered = any(number > 1 for _, number in tests)
    mesh = map_by_angle(axes, [f"{test} {n}" if numbered else test for test, n in tests], values, reach)
    labelled(axes, "angle from +X towards +Y, degrees", title=f"difference, {str(direction).upper()}")
    return mesh


def _overlay(readings: Axes, differences: Axes, run: RunDifference) -> None:
    theta = run.pair.theta_deg
    readings.plot(theta, 1e3 * run.pair.a_mm, color=COLOUR_A, linewidth=1.0, label="A")
    readings.plot(theta, 1e3 * run.pair.b_mm, color=COLOUR_B, linewidth=1.0, label="B")
    readings.set_title(f"{run.pair.label}: {run.rms_um:.1f} µm rms apart")
    readings.legend()
    differences.plot(theta, 1e3 * run.pair.difference_mm, color="#bbbbbb", linewidth=0.6)
    differences.plot(theta, 1e3 * run.smooth_mm, color="black", linewidth=1.2, label="smooth")
    differences.plot(theta, 1e3 * run.found_mm, color=COLOUR_B, linewidth=1.0, linestyle="--", label="found")
    differences.legend()
    zero_line(differences)
    differences.set_xticks(QUARTERS)
    differences.set_xlabel("angle, degrees")
