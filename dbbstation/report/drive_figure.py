"""Figure of one drive."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, ShownFigure, in_style, labelled
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.findings import DriveFindings

MOST_POINTS = 3000
"""Greatest number of drawn points of a line: more points make a larger file and the same picture."""


def drive_figure(diagnosis: DriveFindings, wanted: Wanted = FigureFormat.SVG) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw a diagnosis of a drive, as SVG."""
    with in_style():
        if isinstance(wanted, OnePanel):
            panels = {"force": _force, "residual": _left, "friction": _friction}
            return wanted.draw({name: partial(draw, diagnosis=diagnosis) for name, draw in panels.items()})
        figure = ShownFigure(figsize=(11.0, 6.2), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.6, 1.0))
        force = figure.add_subplot(grid[0, 0])
        left = figure.add_subplot(grid[1, 0], sharex=force)
        _force(force, diagnosis)
        _left(left, diagnosis)
        _friction(figure.add_subplot(grid[:, 1]), diagnosis)
        return in_format(figure, wanted)


def _thinned(diagnosis: DriveFindings) -> dict[str, Floats]:
    step = max(len(diagnosis.table["t_s"]) // MOST_POINTS, 1)
    return {name: column[::step] for name, column in diagnosis.table.items()}


def _force(axes: Axes, diagnosis: DriveFindings) -> None:
    table = _thinned(diagnosis)
    lines = (
        ("measured", "force_n"),
        ("mass and viscous friction", "base_force_n"),
        (_named(diagnosis), "model_force_n"),
    )
    for colour, (label, column) in zip((MEASURED, BEFORE, AFTER), lines, strict=True):
        axes.plot(table["t_s"], table[column], color=colour, label=label, linewidth=0.8)
    axes.axvspan(*diagnosis.held_back.t_s, color="#eeeeee", zorder=0)
    labelled(axes, "", "force, N", "force in the band of the comparison; grey: held back")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3)


def _left(axes: Axes, diagnosis: DriveFindings) -> None:
    table = _thinned(diagnosis)
    for colour, column in zip((BEFORE, AFTER), ("base_force_n", "model_force_n"), strict=True):
        axes.plot(table["t_s"], table["force_n"] - table[column], color=colour, linewidth=0.8)
    errors = diagnosis.held_back.relative_force_error
    axes.axvspan(*diagnosis.held_back.t_s, color="#eeeeee", zorder=0)
    labelled(
        axes,
        "time, s",
        "measured less model, N",
        f"what is left; held back {100 * errors.before:.1f} % -> {100 * errors.after:.1f} % of the force",
    )


def _friction(axes: Axes, diagnosis: DriveFindings) -> None:
    table, curve = diagnosis.table, diagnosis.curve
    base, after = diagnosis.before, diagnosis.parameters
    mass = after["mass_kg"].value if np.isfinite(after["mass_kg"].value) else 0.0
    # Inertia taken off: what is left hangs on friction, load and noise.
    friction = table["force_n"] - mass * 1e-3 * table["acceleration_mm_s2"]
    step = max(len(friction) // MOST_POINTS, 1)
    axes.plot(table["speed_mm_s"][::step], friction[::step], ".", color=MEASURED, markersize=1.5, label="less inertia")
    axes.plot(
        1e3 * curve.speed_m_s,
        base["viscous_n_s_m"].value * curve.speed_m_s,
        color=BEFORE,
        label="mass and viscous friction",
        linewidth=1.0,
    )
    for part in (curve.speed_m_s < 0.0, curve.speed_m_s > 0.0):
        speed, force, sigma = (1e3 * curve.speed_m_s[part], curve.force_n[part], curve.uncertainty_n[part])
        label = _named(diagnosis) if part[-1] else None
        axes.plot(speed, force, color=AFTER, linewidth=1.2, label=label)
        axes.fill_between(speed, force - 2 * sigma, force + 2 * sigma, color=AFTER, alpha=0.25, linewidth=0)
    low, high = np.percentile(friction, [0.5, 99.5])
    margin = 0.2 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    labelled(axes, "speed, mm/s", "force less inertia, N", "friction (band: two standard uncertainties)")
    axes.legend(loc="upper left")


def _named(diagnosis: DriveFindings) -> str:
    count = len(diagnosis.chosen)
    return f"with {count} named cause{'' if count == 1 else 's'}" if count else "nothing more was found"
