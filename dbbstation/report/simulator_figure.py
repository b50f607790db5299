"""Figure of a simulator."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, ShownFigure, in_style, labelled, with_unit
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dbbstation.diagnosis.simulator.answer import SimulatorComparison

MOST_POINTS = 2000
"""Greatest number of drawn points of a cloud: more points make a larger file and the same picture."""


def simulator_figure(answer: SimulatorComparison, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw refitted and corrected differences, and each part's held-out error."""
    with in_style():
        if isinstance(wanted, OnePanel):
            panels = {"rows": _over_time, "signal": _over_signal, "held-out": _held_out}
            return wanted.draw({name: partial(draw, answer=answer) for name, draw in panels.items()})
        figure = ShownFigure(figsize=(7.2, 6.4), layout="constrained")
        grid = figure.add_gridspec(2, 2)
        _over_time(figure.add_subplot(grid[0, :]), answer)
        _over_signal(figure.add_subplot(grid[1, 0]), answer)
        _held_out(figure.add_subplot(grid[1, 1]), answer)
        return in_format(figure, wanted)


def _over_time(axes: Axes, answer: SimulatorComparison) -> None:
    rows, step = np.arange(answer.work.size), max(answer.work.size // MOST_POINTS, 1)
    for left, colour, label in (
        (answer.base.fitted.residual, BEFORE, "refitted"),
        (answer.found.residual, AFTER, "corrected"),
    ):
        axes.plot(rows[::step], left[::step], color=colour, label=label, linewidth=0.8)
    labelled(axes, "row", _label(answer))
    axes.legend()


def _over_signal(axes: Axes, answer: SimulatorComparison) -> None:
    name, values = "simulated value", answer.work.measured - answer.as_simulated * answer.work.scale
    if answer.terms and answer.terms[0].signals:
        term = answer.terms[0]
        signals = answer.work.signals(answer.found.state)[term.port]
        if len(answer.model.runs) == 1 and len(answer.model.outputs) == 1:
            times, first = np.unique(signals["t"], return_index=True)
            values = np.interp(answer.work.time, times, signals[term.signals[0]][first])
            name = f"{term.signals[0]} at {term.port}"
    step = max(len(values) // MOST_POINTS, 1)
    axes.plot(
        values[::step], answer.base.fitted.residual[::step], ".", color=MEASURED, markersize=1.5, label="refitted"
    )
    axes.plot(values[::step], answer.found.residual[::step], ".", color=AFTER, markersize=1.5, label="corrected")
    labelled(axes, name, _label(answer))
    axes.legend()


def _held_out(axes: Axes, answer: SimulatorComparison) -> None:
    if answer.held_out is None:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "held-out parts were not asked for", ha="center", va="center")
        return
    places = np.arange(len(answer.held_out.folds)) + 1
    for errors, colour, label in (
        ([fold.before for fold in answer.held_out.folds], BEFORE, "refitted"),
        ([fold.after for fold in answer.held_out.folds], AFTER, "corrected"),
    ):
        axes.plot(places, errors, "o-", color=colour, label=label, markersize=3)
    axes.set_ylim(bottom=0.0)
    labelled(axes, "held-out part", f"error, {answer.model.outputs[0].unit} rms".replace(",  rms", ", rms"))
    axes.legend()


def _label(answer: SimulatorComparison) -> str:
    return with_unit("measured less simulated", answer.model.outputs[0].unit)
