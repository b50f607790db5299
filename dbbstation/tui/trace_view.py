"""The live polar trace; only changed rows are drawn."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from rich.segment import Segment
from textual.geometry import Region, Size
from textual.strip import Strip
from textual.widget import Widget

from dbbstation.plan.plan import Direction
from dbbstation.service.live_trace import Derived, View
from dbbstation.tui import braille
from dbbstation.tui.polar import (
    BAND_SHARE,
    CELL_ASPECT,
    NOMINAL_SHARE,
    SMALLEST_SCALE_UM,
    Dial,
    draw_scale,
    draw_trace,
    grown_scale_um,
    share_of,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray
    from rich.style import Style

    from dbbstation.plan.plan import Circle
    from dbbstation.service.live_trace import LiveTrace
    from dbbstation.tui.braille import Plane

_SCALE, _CCW, _CW, _LAST, _LABEL = 1, 2, 4, 8, 16
"""Bits of `braille.overlay` for the planes with a dot in a cell, in the order of the planes, and one bit for text."""

_HEADS = {Direction.CCW: "●", Direction.CW: "○"}
"""Marks at the position of a running circle."""

_START_OFFSET_DEG = 9.0
"""Angle from the start's spoke to its word [deg], so that the word covers neither the spoke nor an axis letter."""

_SMALLEST_ROWS = 6
"""Least number of rows for text above and below the circle."""


_PARTS = ("scale", "last", "ccw", "cw", "both", "label")
"""Parts of the view that the style sheet colours."""


class TraceView(Widget):
    """Deviation of the bar about the nominal circle, both directions in one dial."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {f"trace--{part}" for part in _PARTS}

    def __init__(self, *, cell_aspect: float = CELL_ASPECT, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._cell_aspect = cell_aspect
        self._traces: dict[Direction, LiveTrace | Derived] = {}
        self._drawn: dict[Direction, tuple[LiveTrace | Derived, int]] = {}
        self._head: Direction | None = None
        self._beneath: dict[Direction, LiveTrace | Derived] = {}
        self._circle: Circle | None = None
        self._scale_um = SMALLEST_SCALE_UM
        self._dial = Dial(1, 1)
        self._planes: dict[Direction, Plane] = {}
        self._background, self._last = self._dial.empty(), self._dial.empty()
        self._codes: NDArray[np.uint32] = np.zeros((0, 0), dtype=np.uint32)
        self._members: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
        self._captioned = ""

    def show(
        self,
        circle: Circle | None,
        traces: Mapping[Direction, LiveTrace | Derived],
        head: Direction | None = None,
        beneath: Mapping[Direction, LiveTrace | Derived] | None = None,
    ) -> None:
        fresh = circle is not self._circle or any(
            traces.get(direction) is not trace for direction, (trace, _) in self._drawn.items()
        )
        if fresh:
            self._scale_um = SMALLEST_SCALE_UM
        beneath = dict(beneath or {})
        before, after = ({way: id(one) for way, one in each.items()} for each in (self._beneath, beneath))
        self._circle, self._traces, self._head, self._beneath = circle, dict(traces), head, beneath
        drawn = (*traces.values(), *beneath.values())
        scale = grown_scale_um(self._scale_um, max((trace.largest_um for trace in drawn), default=0.0))
        size = Size(self.size.width, self.size.height - 2)
        if fresh or before != after or scale != self._scale_um or size != (self._dial.columns, self._dial.rows):
            self._begin(size, scale)
        self._extend()
        self._compose_cells()

    def _begin(self, size: Size, scale_um: float) -> None:
        self._scale_um = scale_um
        self._dial = Dial(max(size.width, 1), max(size.height, 1), self._cell_aspect)
        self._background = self._dial.empty()
        self._last = self._dial.empty()
        for one in self._beneath.values():
            draw_trace(self._last, self._dial, one.theta_deg, one.deviation_um, scale_um)
        self._planes = {direction: self._dial.empty() for direction in Direction}
        self._drawn = {}
        draw_scale(self._background, self._dial, None if self._circle is None else self._circle.start_deg)

    def _extend(self) -> None:
        for direction, trace in self._traces.items():
            known, done = self._drawn.get(direction, (trace, 0))
            count = len(known)
            if count > done:
                # From the last point that was drawn, so that the line goes on.
                since = max(done - 1, 0)
                draw_trace(
                    self._planes[direction],
                    self._dial,
                    trace.theta_deg[since:count],
                    trace.deviation_um[since:count],
                    self._scale_um,
                    thick=direction is Direction.CCW,
                )
            self._drawn[direction] = (trace, count)

    def _compose_cells(self) -> None:
        planes = (self._background, self._planes[Direction.CCW], self._planes[Direction.CW], self._last)
        codes, members = braille.overlay(planes)
        self._letter(codes, members)
        if codes.shape != self._codes.shape:
            self.refresh()
        else:
            changed = np.flatnonzero(((codes != self._codes) | (members != self._members)).any(axis=1))
            if len(changed):
                self.refresh(*(Region(0, int(row) + 1, self.size.width, 1) for row in changed))
        self._codes, self._members = codes, members
        caption = self._caption()
        if caption != self._captioned:
            self._captioned = caption
            self.refresh(Region(0, 0, self.size.width, 1))

    def _letter(self, codes: NDArray[np.uint32], members: NDArray[np.uint8]) -> None:
        def write(text: str, row: int, column: int) -> None:
            text = text[: max(self._dial.columns - column, 0)]
            codes[row, column : column + len(text)] = [ord(letter) for letter in text]
            members[row, column : column + len(text)] = _LABEL

        rim = NOMINAL_SHARE + BAND_SHARE
        write("X", *self._dial.cell(0.0, 1.05))
        write("Y", *self._dial.cell(90.0, 1.05))
        ring = f"+{self._scale_um:g} µm"
        row, column = self._dial.cell(45.0, rim)
        write(ring, row, min(column + 1, max(self._dial.columns - len(ring), 0)))
        write("0", *self._dial.cell(135.0, NOMINAL_SHARE))
        write(f"-{self._scale_um:g}", *self._dial.cell(135.0, NOMINAL_SHARE - BAND_SHARE))
        if self._circle is not None:
            word = "start"
            row, column = self._dial.cell(self._circle.start_deg - _START_OFFSET_DEG, 1.0)
            write(word, row, min(column, max(self._dial.columns - len(word), 0)))
        trace = None if self._head is None else self._traces.get(self._head)
        if trace is not None and self._head is not None and len(trace):
            theta, deviation = float(trace.theta_deg[-1]), float(trace.deviation_um[-1])
            if np.isfinite(deviation):
                cell = self._dial.cell(theta, share_of(deviation, self._scale_um))
                write(_HEADS[self._head], *cell)

    def on_resize(self) -> None:
        self.show(self._circle, self._traces, self._head, self._beneath)

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self.refresh()

    def render_line(self, y: int) -> Strip:
        wide = self.size.width
        if y == 0:
            segment = Segment(self._caption(), self.rich_style + self._styles()[_LABEL])
            return Strip([segment]).adjust_cell_length(wide, self.rich_style)
        if y == self.size.height - 1:
            return self._legend(wide)
        if self.size.height < _SMALLEST_ROWS or y - 1 >= len(self._codes):
            return Strip.blank(wide, self.rich_style)
        base, styles = self.rich_style, self._styles()
        row = self._codes[y - 1].astype(np.uint32).tobytes().decode("utf-32-le")
        segments = []
        column = 0
        for member, cells in groupby(self._members[y - 1].tolist()):
            length = len(list(cells))
            segments.append(Segment(row[column : column + length], base + styles[member]))
            column += length
        return Strip(segments, len(row)).adjust_cell_length(wide, base)

    def _styles(self) -> dict[int, Style]:
        scale, last, ccw, cw, both, label = (self.get_component_rich_style(f"trace--{part}") for part in _PARTS)
        traces = {0: scale, _LAST: last}
        for member, style in ((_CCW, ccw), (_CW, cw), (_CCW | _CW, both)):
            traces |= {member: style, member | _LAST: style}
        return {member | under: style for member, style in traces.items() for under in (0, _SCALE)} | {_LABEL: label}

    def _caption(self) -> str:
        if self._circle is None or not self._traces:
            return "no circle yet"
        times = self._dial.magnification(self._scale_um, self._circle.radius_mm)
        tests = dict.fromkeys(trace.run.test for trace in self._traces.values())
        what = {View.MEASURED: "+".join(self._traces), View.CENTRED: f"{'+'.join(self._traces)} centred"}
        return (
            f"{' '.join(tests)} {what.get(self._view, self._view)} · ring ±{self._scale_um:g} µm · ×{_rounded(times)}"
        )

    @property
    def _view(self) -> View:
        return next((one.view for one in self._traces.values() if isinstance(one, Derived)), View.MEASURED)

    def _legend(self, wide: int) -> Strip:
        base, styles = self.rich_style, self._styles()
        parts = [("━━ ccw, thick", _CCW), ("   ", 0), ("── cw, thin", _CW), ("   ", 0), ("·· nominal", _SCALE)]
        if self._view is View.DIFFERENCE:
            parts = [("━━ ccw less cw", _CCW), ("   ", 0), ("·· none", _SCALE)]
        if self._beneath:
            # Short, so that 80 columns show all of it.
            parts = [("━━ ccw", _CCW), ("  ", 0), ("── cw", _CW), ("  ", 0), ("── before", _LAST), ("  ", 0), parts[-1]]
        segments = [Segment(text, base + styles[member]) for text, member in parts]
        return Strip(segments).adjust_cell_length(wide, base)


def _rounded(times: float) -> str:
    place = 10.0 ** max(np.floor(np.log10(max(times, 1.0))) - 1.0, 0.0)
    return f"{round(times / place) * place:.0f}"
