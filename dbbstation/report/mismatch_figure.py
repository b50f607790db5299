"""Figure of a table's mismatch."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, ShownFigure, in_style, labelled, with_unit
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.table.mismatch import Mismatch
    from dbbstation.inference.channel import Variable

MOST_POINTS = 500
"""Greatest number of drawn points of a cloud: more points make a larger file and the same picture."""

MOST_VARIABLES = 4
BINS = 40
FEWEST_IN_BIN = 3


def mismatch_figure(found: Mismatch, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw the difference over variables and rows, and each part's held-out error."""
    names = [one.variables[0][0] for one in found.levels.follows][:MOST_VARIABLES]
    variables = [v for name in names for v in found.settled.channel.variables if v.name == name]
    wide = max(len(variables), 2)
    before, after = _residuals(found)
    with in_style():
        if isinstance(wanted, OnePanel):
            over = {
                v.name: partial(_over, variable=v, before=before, after=after, unit=found.table.unit) for v in variables
            }
            rows = {"rows": partial(_over_rows, before=before, after=after, found=found)}
            return wanted.draw(over | rows | {"held-out": partial(_held_out, found=found)})
        figure = ShownFigure(figsize=(3.4 * wide, 6.4), layout="constrained")
        grid = figure.add_gridspec(2, wide)
        for k, variable in enumerate(variables):
            _over(figure.add_subplot(grid[0, k]), variable, before, after, found.table.unit)
        if not variables:
            _histogram(figure.add_subplot(grid[0, :]), before, found.table.unit)
        split = max(wide - 1, 1)
        _over_rows(figure.add_subplot(grid[1, :split]), before, after, found)
        _held_out(figure.add_subplot(grid[1, split:]), found)
        return in_format(figure, wanted)


def _residuals(found: Mismatch) -> tuple[Floats, Floats]:
    channel = found.settled.channel
    base = channel.base.samples @ np.array([f.before.value for f in found.fitted])
    return channel.residual - base, channel.residual - found.explained


def _over(axes: Axes, variable: Variable, before: Floats, after: Floats, unit: str) -> None:
    step = max(len(before) // MOST_POINTS, 1)
    axes.plot(variable.values[::step], before[::step], ".", color=MEASURED, markersize=1.2, alpha=0.5)
    for values, colour, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        at, mean = _means(variable.values, values)
        axes.plot(at, mean, color=colour, label=label, linewidth=1.2)
    labelled(axes, with_unit(variable.name, variable.unit), with_unit("measured less simulated", unit))
    axes.legend(loc="upper right")


def _means(at: Floats, values: Floats) -> tuple[Floats, Floats]:
    edges = np.linspace(at.min(), at.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, BINS - 1)
    counts = np.bincount(place, minlength=BINS)
    means = np.bincount(place, values, minlength=BINS) / np.maximum(counts, 1)
    return 0.5 * (edges[1:] + edges[:-1]), np.where(counts >= FEWEST_IN_BIN, means, np.nan)


def _histogram(axes: Axes, before: Floats, unit: str) -> None:
    axes.hist(before, BINS, color=MEASURED)
    labelled(axes, with_unit("measured less simulated", unit), "rows", "nothing was found that it follows")


def _over_rows(axes: Axes, before: Floats, after: Floats, found: Mismatch) -> None:
    step = max(len(before) // MOST_POINTS, 1)
    rows = np.arange(len(before))[::step]
    axes.plot(rows, before[::step], color=BEFORE, linewidth=0.5, label="before")
    axes.plot(rows, after[::step], color=AFTER, linewidth=0.5, label="after")
    for block in found.table.blocks[1:]:
        axes.axvline(block.start, color=MEASURED, linewidth=0.5, linestyle=":")
    row = "row (dotted: runs)" if len(found.table.blocks) > 1 else "row"
    labelled(axes, row, with_unit("measured less simulated", found.table.unit))
    axes.legend(loc="upper right")


def _held_out(axes: Axes, found: Mismatch) -> None:
    if found.held_out is None:
        axes.set_axis_off()
        return
    folds = found.held_out.folds
    at = np.arange(len(folds))
    pairs: Any = (("before", BEFORE, [f.before for f in folds]), ("after", AFTER, [f.after for f in folds]))
    for k, (label, colour, values) in enumerate(pairs):
        axes.bar(at + 0.4 * k, values, 0.4, color=colour, label=label)
    axes.set_xticks(at + 0.2, [str(k + 1) for k in at])
    title = f"held out: {found.held_out.before:.3g} -> {found.held_out.after:.3g} {found.table.unit}".rstrip()
    labelled(axes, "part held out", with_unit("rms error", found.table.unit), title)
    axes.legend(loc="upper right")
