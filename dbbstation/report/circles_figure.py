"""Traces of measured circles over the angle, a panel for each run."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from dbbstation.report.drawing import AFTER, QUARTERS, ShownFigure, in_style
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.panel import OnePanel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.results.circles import Circled

COLUMNS = 4


def circles_figure(found: Circled, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw the deviation of each circle from its least-squares circle."""
    runs = [(one.entry.label, one.analysis) for one in found.circles if one.analysis is not None]
    with in_style():
        if isinstance(wanted, OnePanel):
            return wanted.draw({name: partial(_trace, name=name, analysis=one) for name, one in runs})
        rows = -(-len(runs) // COLUMNS)
        figure = ShownFigure(figsize=(11.0, 2.2 * rows), layout="constrained")
        panels: Any = figure.subplots(rows, min(COLUMNS, len(runs)), sharex=True, squeeze=False)
        for axes, (name, one) in zip(panels.flat, runs, strict=False):
            _trace(axes, name, one)
        for axes in panels.flat[len(runs) :]:
            axes.set_axis_off()
        return in_format(figure, wanted)


def _trace(axes: Axes, name: str, analysis: CircleAnalysis) -> None:
    axes.plot(analysis.path.theta_deg, analysis.residual_um, ".", color=AFTER, markersize=1.5)
    axes.set_xticks(QUARTERS)
    axes.set_xlabel("angle from +X towards +Y, degrees")
    axes.set_ylabel("deviation, µm")
    axes.set_title(f"{name}: G {analysis.g_um:.2f} µm")
