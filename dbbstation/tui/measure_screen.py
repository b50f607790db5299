"""The screen beside the machine: live reading, trace, set-up, figures and all runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, ClassVar

from textual.containers import Horizontal, Vertical
from textual.widgets import Footer

from dbbstation.tui.board_screen import RunScreen
from dbbstation.tui.figures_panel import FiguresPanel
from dbbstation.tui.jig_map import JigMap
from dbbstation.tui.message_lines import MessageLines
from dbbstation.tui.now_line import NowLine
from dbbstation.tui.progress_line import ProgressLine
from dbbstation.tui.reading_panel import ReadingPanel
from dbbstation.tui.run_list import RunList
from dbbstation.tui.set_up_panel import SetUpPanel
from dbbstation.tui.steps_panel import StepsPanel
from dbbstation.tui.title_line import TitleLine
from dbbstation.tui.trace_view import TraceView

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.plan.circle import Direction
    from dbbstation.service.live_trace import Centred, LiveTrace
    from dbbstation.tui.board_screen import Desk
    from dbbstation.tui.shown import Shown


class MeasureScreen(RunScreen):
    """The screen that the station opens with.

    Args:
        desk: has the board, and takes commands.
        shown: plan and plate.
        clock: real time, for telling an old reading [s].
    """

    help_name = "measure"

    BINDINGS: ClassVar[list[BindingType]] = [("v", "view", "View")]

    DEFAULT_CSS = """
    MeasureScreen {
        #middle { height: 1fr; }
        #trace { width: 1fr; padding: 0 1; }
        #side { width: 40%; min-width: 38; max-width: 52; padding: 0 1 0 0; }
        #side > * { margin-bottom: 1; }
        #table { height: 5; }
        &.-low StepsPanel { display: none; }
    }
    """

    def __init__(self, desk: Desk, shown: Shown, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(desk)
        self._clock = clock
        self._show = shown
        self._centred = False

    def compose(self) -> ComposeResult:
        """Put the parts where they belong."""
        yield TitleLine(self._show.plan, id="title")
        yield NowLine(id="now")
        with Horizontal(id="middle"):
            yield TraceView(cell_aspect=self._show.cell_aspect, id="trace")
            with Vertical(id="side"):
                yield ReadingPanel(clock=self._clock, id="reading")
                with Horizontal(id="table"):
                    yield SetUpPanel(id="set-up")
                    yield JigMap(self._show.bores, id="map")
                yield StepsPanel(id="steps")
                yield FiguresPanel(id="figures")
                yield RunList(id="runs")
        yield ProgressLine(id="progress")
        yield MessageLines(id="messages")
        yield Footer(show_command_palette=False)

    def draw(self) -> None:
        """Draw panels and trace."""
        super().draw()
        board = self.desk.board
        for view in self.query(TraceView):
            view.show(board.circle, self._shown_traces(), None if self._centred else board.running)

    def _shown_traces(self) -> Mapping[Direction, LiveTrace | Centred]:
        """Traces as measured, or those of complete circles about their own centre."""
        traces = self.desk.board.traces
        if not self._centred:
            return traces
        return {way: trace.centred for way, trace in traces.items() if trace.centred is not None}

    def action_view(self) -> None:
        """Change between the circle as measured and its form about its own centre."""
        self._centred = not self._centred
        self.draw()
