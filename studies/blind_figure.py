"""Reliability diagram of a blind study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, in_style
from dbbstation.report.figure_format import FigureFormat, Stamped, in_format

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

PANEL_IN = (4.2, 3.6)


def reliability_figure(
    reliability: Mapping[str, Sequence[Mapping[str, Any]]], wanted: FigureFormat | Stamped = FigureFormat.SVG
) -> bytes:
    """Draw a diagram per table of `blind_reliability.reliability`, with bins of equal width."""
    with in_style():
        figure = Figure(figsize=(PANEL_IN[0] * len(reliability), PANEL_IN[1]), layout="constrained")
        panels = figure.subplots(1, len(reliability), sharey=True, squeeze=False)[0]
        for axes, (title, table) in zip(panels, reliability.items(), strict=True):
            _panel(axes, table)
            axes.set_title(title)
        panels[0].set_ylabel("share that is there")
        panels[0].legend(loc="upper left")
        return in_format(figure, wanted)


def _panel(axes: Axes, table: Sequence[Mapping[str, Any]]) -> None:
    for place, entry in enumerate(table):
        axes.fill_between([place - 0.5, place + 0.5], entry["from"], entry["to"], color="#e4e4e4", linewidth=0)
    seen = [(place, entry) for place, entry in enumerate(table) if entry["count"]]
    places = [place for place, _ in seen]
    means, shares = ([entry[key] for _, entry in seen] for key in ("mean_probability", "share"))
    away = [[abs(entry["share"] - entry["interval"][side]) for _, entry in seen] for side in (0, 1)]
    axes.plot(places, means, "_", color=BEFORE, markersize=22, label="stated, mean")
    axes.errorbar(places, shares, away, fmt="o", color=AFTER, markersize=4, capsize=3, label="true, 95 % interval")
    ticks = [f"{entry['from']:g}\nto {entry['to']:g}\n({entry['count']})" for entry in table]
    axes.set_xticks(range(len(table)), ticks, color=MEASURED)
    axes.set_xlim(-0.5, len(table) - 0.5)
    axes.set_ylim(-0.02, 1.02)
    axes.set_xlabel("stated probability (verdicts)")
