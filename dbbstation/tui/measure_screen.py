"""The screen at the machine."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, ClassVar

from textual.containers import Horizontal, Vertical
from textual.content import Content

from dbbstation.service.board import RunDecision
from dbbstation.service.live_trace import View
from dbbstation.station.states import VERDICT, State
from dbbstation.tui.board_screen import RunScreen
from dbbstation.tui.footer import KeyFooter
from dbbstation.tui.messages_screen import MessageLines
from dbbstation.tui.now_line import NowLine, ProgressLine, TitleLine
from dbbstation.tui.panel import Panel, lines
from dbbstation.tui.run_list import FindingsPanel, RunList
from dbbstation.tui.set_up_panel import set_up
from dbbstation.tui.trace_view import TraceView

if TYPE_CHECKING:
    from collections.abc import Callable

    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted
    from dbbstation.tui.app import StationApp
    from dbbstation.tui.board_screen import Shown


_NAME = 12

_WIDE = 46
"""Least number of columns at which X and Y of the centre are beside its distance."""

_DISTANCE, _MEAN = (8, 7), (7, 6)
"""Columns of a centre's distance and of a mean, first with free space, then beside X and Y."""


class FiguresPanel(Panel):
    """A table of at most two runs, for both directions."""

    def text(self, board: Board) -> Content:
        wide = self.content_size.width >= _WIDE
        centre = f"{'X':>7}{'Y':>7}" if wide else ""
        titles = f"{'figures [µm]':{_NAME}}{centre}{'centre':>{_DISTANCE[wide]}}{'mean':>{_MEAN[wide]}}{'circul.':>8}"
        rows = [
            _row(result, board.verdicts.get(result.run.label, RunDecision.NONE), wide=wide) for result in board.results
        ]
        empty = Content.styled("of the finished runs stand here", "dim")
        return lines(Content.styled(titles, "dim"), *(rows or [empty]))


def _row(completed: RunCompleted, verdict: RunDecision, *, wide: bool) -> Content:
    figures = completed.figures
    rejected = verdict is RunDecision.REJECTED
    name = f"{_short(f'x {completed.run.label}' if rejected else completed.run.label):{_NAME}}"
    if figures is None:
        return Content(f"{name}no circle")
    centre = "".join(f"{1e3 * part:+7.1f}" for part in figures.centre_mm) if wide else ""
    sizes = f"{figures.centre_deviation_um:{_DISTANCE[wide]}.1f}{figures.mean_radial_error_um:+{_MEAN[wide]}.1f}{figures.circularity_um:8.1f}"
    row = f"{name}{centre}{sizes}"
    return Content.styled(row, "dim strike") if rejected else Content(row)


def _short(label: str) -> str:
    if len(label) < _NAME:
        return label
    sign = "x " if label.startswith("x ") else ""
    return f"{sign}…{label[2 + len(sign) - _NAME :]}"


class MeasureScreen(RunScreen):
    """The station's first screen."""

    help_name = "measure"

    BINDINGS: ClassVar[list[BindingType]] = [
        # The next step when the plan is through; before, the application has the key and the footer no room.
        ("e", "to_results", "Results"),
        ("g", "view", "View"),
    ]

    def __init__(self, desk: StationApp, shown: Shown, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(desk, shown, clock=clock)
        self._view = View.MEASURED

    def compose(self) -> ComposeResult:
        yield TitleLine(self._show.plan, id="title")
        yield NowLine(id="now")
        with Horizontal(id="middle"):
            yield TraceView(cell_aspect=self._show.cell_aspect, id="trace")
            with Vertical(id="side"):
                yield from set_up(self._show.bores, self._clock)
                yield FiguresPanel(id="figures")
                yield FindingsPanel(id="findings")
                yield RunList(id="runs")
        yield ProgressLine(id="progress")
        yield MessageLines(id="messages")
        yield KeyFooter()

    def draw(self) -> None:
        super().draw()
        board = self.desk.board
        views = board.views
        view = self._view if self._view in views else View.MEASURED
        for trace in self.query(TraceView):
            trace.show(
                board.circle, views[view], board.running if view is View.MEASURED else None, board.beneath.get(view, {})
            )
        judged = board.state in VERDICT and board.completed is not None and bool(board.completed.findings)
        self.set_class(judged, "-verdict")

    def keys(self) -> object:
        return super().keys(), len(self.desk.board.views)

    def offers_view(self) -> bool:
        return len(self.desk.board.views) > 1

    def offers_to_results(self) -> bool:
        return self.desk.board.state is State.FINISHED and bool(self.app.check_action("results", ()))

    async def action_to_results(self) -> None:
        await self.run_action("app.results")

    def action_view(self) -> None:
        views = list(self.desk.board.views)
        at = views.index(self._view) if self._view in views else 0
        self._view = views[(at + 1) % len(views)]
        self.draw()
