"""One figure of measured circles with title block."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation import __version__
from dbbstation.computing.grouped import grouped
from dbbstation.errors import StationError
from dbbstation.report.conditions import conditions
from dbbstation.report.drawing import AFTER, BEFORE, QUARTERS, in_style, labelled
from dbbstation.report.figure_format import Wanted, in_format
from dbbstation.report.plot_panels import CAPTION_IN, draw_deviation, draw_map, draw_polar, draw_spectrum, draw_together
from dbbstation.report.polar import chosen
from dbbstation.report.sheet import MARGIN_IN, Box, Cell, Key, Sheet
from dbbstation.results.frame import OnePanel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.circles.path import Filter
    from dbbstation.report.plot_panels import Drawn
    from dbbstation.results.circles import Circled, MeasuredCircle

MOST_DRAWN = 20
"""Repeats of one direction that are drawn: more cover one another even as thin lines. The others are counted on the sheet."""

NARROW_IN, WIDE_IN = 7.5, 11.0
"""Width of a sheet with one panel, and with several: those fit A4 upright and across [inch]."""

_GAP_IN = 0.2


class PlotKind(StrEnum):
    """Kinds of figures."""

    POLAR = "polar"
    DEVIATION = "deviation"
    SPECTRUM = "spectrum"
    MAP = "map"
    COMPARE = "compare"


TITLES = {
    PlotKind.POLAR: "Deviation from the least-squares circle, polar",
    PlotKind.DEVIATION: "Deviation from the least-squares circle over the angle",
    PlotKind.SPECTRUM: "Undulations of the circles: amplitude by number per revolution",
    PlotKind.MAP: "Centres of the circles where their balls stand, seen from above",
    PlotKind.COMPARE: "The same tests in several sessions, to one scale each",
}


@dataclass(frozen=True, eq=False)
class PlotPanel:
    """Runs of one picture: both directions of a test in a session."""

    session: str
    test: str
    drawn: tuple[Drawn, ...]
    not_drawn: int


@dataclass(frozen=True, eq=False)
class Plotted:
    """Content of a sheet."""

    kind: PlotKind
    found: Circled
    chosen: Filter

    def panels(self) -> list[PlotPanel]:
        """Return panels by session.

        Raises:
            StationError: no run shows a circle; a comparison has only one session with circles.
        """
        shown = self.found.shown
        if not shown:
            why = "; ".join(f"{one.entry.label}: {one.problem}" for one in self.found.circles)
            raise StationError(f"no run shows a circle: {why}", remedy="record the test again, or choose another")
        several = {one.session for one in shown}
        if self.kind is PlotKind.COMPARE and len(several) == 1:
            raise StationError(
                f"only one session is there to compare, {several.pop()}", remedy="name two sessions or more"
            )
        of = grouped(((one.session, one.entry.test), one) for one in shown)
        drawn = {key: chosen(runs, MOST_DRAWN) for key, runs in of.items()}
        return [PlotPanel(*key, tuple(drawn[key]), len(runs) - len(drawn[key])) for key, runs in of.items()]

    def on_sheet(self) -> list[MeasuredCircle]:
        """Return the drawn runs; a map averages all circles."""
        if self.kind is PlotKind.MAP:
            return self.found.shown
        return [one for panel in self.panels() for one, _ in panel.drawn]


def circles_figure(kind: str, found: Circled, chosen: Filter, wanted: Wanted) -> Any:  # noqa: ANN401 - as `in_format`
    """Return a reproducible sheet; one panel is a run's deviation over the angle.

    Raises:
        StationError: as `Plotted.panels`.
    """
    plotted = Plotted(PlotKind(kind), found, chosen)
    with in_style(), warnings.catch_warnings():
        # A name in letters that no font here has becomes boxes in PNG and PDF; in SVG the viewer's fonts have them.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        if isinstance(wanted, OnePanel):
            if plotted.kind not in {PlotKind.POLAR, PlotKind.DEVIATION}:
                raise StationError(
                    f"one panel has the deviation of one run, not a {plotted.kind}",
                    remedy="draw the whole figure, without Axes",
                )
            runs = {one.entry.label: one.analysed for one in plotted.found.shown}
            return wanted.draw({name: partial(_trace, name=name, analysis=one) for name, one in runs.items()})
        return in_format(draw_circles(plotted), wanted)


def _trace(axes: Axes, name: str, analysis: CircleAnalysis) -> None:
    polar = axes.name == "polar"
    theta = np.radians(analysis.path.theta_deg) if polar else analysis.path.theta_deg
    axes.plot(theta, analysis.residual_um, ".", color=AFTER, markersize=1.5)
    axes.set_xticks(np.radians(QUARTERS[:-1]) if polar else QUARTERS)
    labelled(axes, "angle from +X towards +Y, degrees", "deviation, µm", f"{name}: G(LS) {analysis.g_um:.2f} µm")


def draw_circles(plotted: Plotted) -> Figure:
    """Draw a sheet.

    Raises:
        StationError: as `Plotted.panels`.
    """
    panels = plotted.panels()
    match plotted.kind:
        case PlotKind.MAP:
            return _map(plotted)
        case PlotKind.COMPARE:
            return _compare(plotted, panels)
    return _grid(plotted, panels)


def _grid(plotted: Plotted, panels: Sequence[PlotPanel]) -> Figure:
    draw, most_columns, share = GRIDS[plotted.kind]
    sheet, boxes = _laid_out(plotted, len(panels), most_columns, share, panels)
    for box, panel in zip(boxes, panels, strict=True):
        name = f"{panel.session}: test {panel.test}" if len(plotted.found.sessions) > 1 else f"test {panel.test}"
        draw(sheet, box, name, panel.drawn)
    return sheet.figure


GRIDS = {
    PlotKind.POLAR: (draw_polar, 4, 1.0),
    PlotKind.DEVIATION: (draw_deviation, 2, 0.5),
    PlotKind.SPECTRUM: (draw_spectrum, 2, 0.55),
}
"""What draws a test in kinds of figures that lay tests out in a grid; greatest number of columns; height over width."""


def _laid_out(
    plotted: Plotted, count: int, most_columns: int, share: float, panels: Sequence[PlotPanel] = ()
) -> tuple[Sheet, list[Box]]:
    columns = min(most_columns, count)
    rows = -(-count // columns)
    width_in = NARROW_IN if columns == 1 else WIDE_IN
    each = (width_in - 2.0 * MARGIN_IN - (columns - 1) * _GAP_IN) / columns
    height = share * each + (CAPTION_IN if panels else 0.0)
    sheet = _sheet(plotted, width_in, rows * height + (rows - bool(panels)) * _GAP_IN, panels)
    places = [divmod(k, columns) for k in range(count)]
    return sheet, [
        Box(MARGIN_IN + column * (each + _GAP_IN), sheet.top_in - (row + 1) * height - row * _GAP_IN, each, height)
        for row, column in places
    ]


def _compare(plotted: Plotted, panels: Sequence[PlotPanel]) -> Figure:
    tests = {panel.test: [other for other in panels if other.test == panel.test] for panel in panels}
    columns = max(len(of) for of in tests.values())
    width_in = NARROW_IN if columns <= 2 else WIDE_IN  # noqa: PLR2004 - two stand side by side upright
    inner = width_in - 2.0 * MARGIN_IN
    each = (inner - (columns - 1) * _GAP_IN) / columns
    heights = (each + CAPTION_IN, 2.2)
    room = len(tests) * (sum(heights) + 2.0 * _GAP_IN)
    sheet = _sheet(plotted, width_in, room, panels)
    top = sheet.top_in
    for test, of in tests.items():
        reach_um = max(float(abs(one.analysed.residual_um).max()) for panel in of for one, _ in panel.drawn)
        for column, panel in enumerate(of):
            left = MARGIN_IN + column * (each + _GAP_IN)
            box = Box(left, top - heights[0], each, heights[0])
            draw_polar(sheet, box, f"{panel.session}: test {test}", panel.drawn, reach_um)
        below = Box(MARGIN_IN, top - heights[0] - _GAP_IN - heights[1], inner, heights[1])
        last = {panel.session: [one for one, thin in panel.drawn if not thin] for panel in of}
        draw_together(sheet, below, f"test {test}, last run of each direction", last)
        top -= sum(heights) + 2.0 * _GAP_IN
    return sheet.figure


def _map(plotted: Plotted) -> Figure:
    shown = plotted.found.shown
    sessions = [s for s in plotted.found.sessions if any(one.session == s.name for one in shown)]
    sheet, boxes = _laid_out(plotted, len(sessions), 2, 1.0)
    for box, session in zip(boxes, sessions, strict=True):
        name = f"{session.name}, plan {session.plan.name}" if len(sessions) > 1 else ""
        draw_map(sheet, box, name, session.plan.tests, [one for one in shown if one.session == session.name])
    return sheet.figure


def _sheet(plotted: Plotted, width_in: float, room_in: float, panels: Sequence[PlotPanel]) -> Sheet:
    tests = list(dict.fromkeys(one.entry.test for one in plotted.found.circles))
    title = f"{TITLES[plotted.kind]}: test{'s' if len(tests) > 1 else ''} {', '.join(tests)}"
    return Sheet(width_in, room_in, title, _keys(plotted, panels), _title_block(plotted, panels))


def _keys(plotted: Plotted, panels: Sequence[PlotPanel]) -> list[Key]:
    if plotted.kind is PlotKind.MAP:
        return [
            Key("ball", {"color": "#555555", "marker": "o", "markersize": 4.0, "linewidth": 0.0}),
            Key("from the ball to the mean centre of the test's circles, enlarged", {"color": AFTER, "linewidth": 1.4}),
        ]
    present = dict.fromkeys(str(one.entry.direction) for panel in panels for one, _ in panel.drawn)
    words = {"ccw": "counter-clockwise (CCW)", "cw": "clockwise (CW)"}
    styles: dict[str, dict[str, object]] = {
        "ccw": {"color": AFTER, "linewidth": 1.2},
        "cw": {"color": BEFORE, "linewidth": 1.2, "linestyle": "--"},
    }
    keys = [Key(words[name], styles[name]) for name in words if name in present]
    if any(thin for panel in panels for _, thin in panel.drawn):
        keys.append(Key("thin: earlier repeats", {"color": "#555555", "linewidth": 0.4}))
    return keys


def _title_block(plotted: Plotted, panels: Sequence[PlotPanel]) -> list[list[Cell]]:
    rows = []
    for session in plotted.found.sessions:
        of = [one for one in plotted.on_sheet() if one.session == session.name]
        if not of:
            continue
        said = dict(conditions(session, of, ""))
        rows += [
            [
                Cell("machine", said["machine"], 1.5),
                Cell("serial number", said["serial number"]),
                Cell("operator", said["operator"], 1.5),
                Cell("plan", said["plan"], 1.5),
            ],
            [Cell("session", session.name), Cell("measured", said["measured"], 1.6), Cell("bar", _bar(said), 2.4)],
        ]
    left_out = sum(panel.not_drawn for panel in panels)
    notes = [f"{left_out} earlier repeats are not drawn"] if left_out else []
    notes += [
        f"test {panel.test}: {_directions(panel.drawn)[0].upper()} only"
        for panel in panels
        if len(_directions(panel.drawn)) == 1
    ]
    notes += [f"{one.entry.label} shows no circle" for one in plotted.found.circles if one.problem]
    rows.append(
        [
            Cell("filter of G", plotted.chosen.words, 1.0),
            Cell("notes", "; ".join(notes) or "none", 3.5),
            Cell("program", f"dbbstation {__version__}", 1.2),
        ]
    )
    return rows


def _bar(said: dict[str, str]) -> str:
    if "bar calibrated" not in said:
        return said["bar"]
    return f"{said['bar']}, {said['bar calibrated']}"


def _directions(drawn: Sequence[Drawn]) -> list[str]:
    return list(dict.fromkeys(str(one.entry.direction) for one, _ in drawn))
