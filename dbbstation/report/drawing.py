"""Common style of figures, and maps over test and angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from dbbstation.plan.plan import Direction
from dbbstation.report.figure_format import as_svg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from contextlib import AbstractContextManager

    LineStyle: TypeAlias = dict[str, Any]
    """Style of a line or marker, by the names of Matplotlib."""

    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import SubFigure

    from dbbstation.calibration.reporting.residual_map import ResidualMap
    from dbbstation.computing.arrays import Floats


class ShownFigure(Figure):
    """A figure that a notebook shows without pyplot."""

    def draw(self, renderer: RendererBase) -> None:
        """Draw the figure; to save it, only lay it out first, since Matplotlib then draws it again without a layout."""
        layout = self.get_layout_engine()
        if self.canvas.is_saving() and isinstance(layout, ConstrainedLayoutEngine):
            layout.execute(self)
        else:
            super().draw(renderer)

    def _repr_svg_(self) -> str:
        return as_svg(self, {}).decode("utf-8")


STYLE: Any = {
    "svg.hashsalt": "dbbstation",
    "svg.fonttype": "none",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],  # named with every text
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
}
"""Style settings: the same input makes the same bytes, and text stays text."""

MEASURED, BEFORE, AFTER = "#555555", "#d55e00", "#0072b2"
"""Colours that the colour-blind distinguish [Okabe and Ito, Color Universal Design, 2008], and that differ in grey."""

SET = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Further colours of the same set, for heights of balls, or sessions."""

DIVERGING = "RdBu_r"
"""Red and blue about white, which all but the totally colour-blind distinguish [Brewer, ColorBrewer]."""

QUARTERS = range(0, 361, 90)

WIDTH_IN = 11.0
LINE_OF_DIRECTION = {Direction.CCW: "-", Direction.CW: "--"}

ROW_IN = 0.15
"""Height of a row of a map [inch]."""


def in_style() -> AbstractContextManager[None]:
    """Draw all figures within the context in the common style."""
    return mpl.rc_context(STYLE)


def labelled(axes: Axes, x: str, y: str = "", title: str = "") -> None:
    """Name the axes and the panel."""
    axes.set(xlabel=x, ylabel=y, **({"title": title} if title else {}))


def with_unit(text: str, unit: str) -> str:
    """Return an axis's label; a quantity without a unit has none."""
    return f"{text}, {unit}" if unit else text


def heading(part: SubFigure, text: str) -> None:
    """Write the heading of a part of a figure."""
    part.suptitle(text, fontsize=9, x=0.01, ha="left")


def zero_line(axes: Axes) -> None:
    """Mark zero."""
    axes.axhline(0.0, color="black", linewidth=0.5, linestyle=":")


def legend_above(part: SubFigure, axes: Axes, lines: Mapping[str, LineStyle]) -> None:
    """Write the legend of a part of a figure in one row, by label and style of each line."""
    handles = [axes.plot([], [], label=label, **style)[0] for label, style in lines.items()]
    part.legend(handles=handles, loc="upper right", ncols=len(handles), borderpad=0.0)


DIRECTIONS: dict[str, LineStyle] = {
    name.upper(): {"color": "black", "linewidth": 0.9, "linestyle": line} for name, line in LINE_OF_DIRECTION.items()
}
"""Style of a direction of travel in a legend."""


def draw_maps(panels: Sequence[Axes], titles: Sequence[str], maps: Sequence[ResidualMap], noise_um: float) -> QuadMesh:
    """Draw maps by direction with one scale, white at zero.

    Args:
        noise_um: noise of a reading; the scale's range is at least this.
    """
    reach = max(noise_um, *(one.reach_um for one in maps))
    drawn = [(title, one, direction) for title, one in zip(titles, maps, strict=True) for direction in Direction]
    for axes, (title, _, direction) in zip(panels, drawn, strict=True):
        axes.set_title(f"{title}, {str(direction).upper()}")
    panels[0].set_ylabel("test")
    meshes = [
        _map(axes, one.tests, one.um[direction], reach) for axes, (_, one, direction) in zip(panels, drawn, strict=True)
    ]
    return meshes[0]


def _map(axes: Axes, tests: Sequence[str], values: Floats, reach: float) -> QuadMesh:
    mesh = map_by_angle(axes, tests, np.ma.masked_invalid(values), reach)
    mesh.set_clip_on(False)
    axes.set_facecolor("#cccccc")  # nothing recorded
    axes.set_xlabel("angle from +X to +Y, °")
    return mesh


def map_by_angle(axes: Axes, names: Sequence[str], values: Floats, reach: float) -> QuadMesh:
    """Draw a row per name over the angle, values shape (names, angles)."""
    edges = np.linspace(0.0, 360.0, values.shape[1] + 1)
    mesh = axes.pcolormesh(edges, np.arange(len(names) + 1), values, cmap=DIVERGING, vmin=-reach, vmax=reach)
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.set_ylim(len(names), 0)
    axes.set_xticks(QUARTERS)
    return mesh
