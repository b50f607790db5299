"""The screen of the station: one screen for a whole plan. It draws what happened and sends what is pressed."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol

from textual.app import App
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widgets import Footer

from dbbstation.service.board import Board
from dbbstation.station.commands import Accept, Command, Pause, Quit, Reject, Repeat, Resume, Skip, Start
from dbbstation.station.states import FINAL, RECORDING
from dbbstation.tui.figures_panel import FiguresPanel
from dbbstation.tui.jig_map import JigMap
from dbbstation.tui.message_lines import MessageLines
from dbbstation.tui.now_line import NowLine
from dbbstation.tui.panel import Panel
from dbbstation.tui.progress_line import ProgressLine
from dbbstation.tui.question import GiveUpQuestion
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
    from dbbstation.service.board import SequenceOpened
    from dbbstation.service.live_trace import Centred, LiveTrace
    from dbbstation.station.events import Event

LOOK_S = 0.1
"""Between looks into the mailbox [s]: ten pictures per second are fluent, more is work that nobody sees."""

_COMMANDS: dict[str, Command] = {
    "start": Start(),
    "touched": Start(remounted=True),
    "accept": Accept(),
    "repeat": Repeat(),
    "reject": Reject(),
    "skip": Skip(),
    "pause": Pause(),
    "resume": Resume(),
}

_GIVES_UP = {"repeat": "Repeat", "reject": "Reject"}
"""Commands that end a running circle, as the question before them says."""

_TALL_ROWS = 32
"""From so many rows on there is room for more than the necessary."""

DARK, LIGHT = "textual-dark", "textual-light"


class Sequence(Protocol):
    """What the screen needs of whatever runs the sequence; `Runner` does."""

    @property
    def alive(self) -> bool:
        """Whether a sequence is being run."""

    @property
    def crash(self) -> Exception | None:
        """What ended it and should not have: a mistake in the program."""

    def start(self) -> None:
        """Open instrument and session and run."""

    def send(self, command: Command) -> bool:
        """Pass a command on; return whether anybody is there to take it."""

    def mail(self) -> list[Event | SequenceOpened]:
        """Return what has come since the last call."""

    def close(self) -> None:
        """End the sequence and wait for that."""


@dataclass(frozen=True)
class Shown:
    """What the screen shows that no event tells.

    Attributes:
        plan: its name.
        bores: number of each bore of the jig plate with its x, y on the plate [mm].
        cell_aspect: height of a terminal's cell over its width.
    """

    plan: str
    bores: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    cell_aspect: float = 2.0


class StationApp(App[None]):
    """The screen.

    Args:
        shown: plan and plate.
        runner: runs the sequence; started when the screen stands.
        clock: real time, for telling an old reading [s].
    """

    TITLE = "dbbstation"
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    #middle { height: 1fr; }
    #trace { width: 1fr; padding: 0 1; }
    #side { width: 40%; min-width: 38; max-width: 52; padding: 0 1 0 0; }
    #side > * { margin-bottom: 1; }
    #table { height: 5; }
    .-low StepsPanel { display: none; }
    """
    VERTICAL_BREAKPOINTS = [(0, "-low"), (_TALL_ROWS, "-tall")]  # noqa: RUF012 - declared by Textual, as an attribute of instances
    BINDINGS: ClassVar[list[BindingType]] = [
        ("enter", "tell('start')", "Start"),
        ("m", "tell('touched')", "Start, new mounting"),
        ("a", "tell('accept')", "Accept"),
        ("r", "tell('repeat')", "Repeat"),
        ("x", "tell('reject')", "Reject"),
        ("s", "tell('skip')", "Skip"),
        ("p", "tell('pause')", "Pause"),
        ("p", "tell('resume')", "Go on"),
        ("v", "view", "View"),
        ("c", "connect", "Connect again"),
        ("d", "brightness", "Dark/light"),
        ("q", "leave", "Quit"),
        # Textual's own meaning of these keys would close the screen without a question, or copy text.
        Binding("ctrl+c,ctrl+q", "leave", show=False, priority=True),
    ]

    def __init__(self, shown: Shown, runner: Sequence, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self.board = Board()
        self._show = shown
        self._runner = runner
        self._keys: object = None
        self._leaving = False
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
        yield Footer()

    def on_ready(self) -> None:
        """Begin to measure, and to look, once every part stands."""
        self._runner.start()
        self.set_interval(LOOK_S, self.look)

    def on_unmount(self) -> None:
        """Whatever closed the screen, the sequence ends in order."""
        self._runner.close()

    def look(self) -> None:
        """Take the mail and draw what changed."""
        for event in self._runner.mail():
            self.board.take(event)
        self._drop_stale_question()
        self.draw()
        if self._runner.crash is not None or (self._leaving and not self._runner.alive):
            self.exit()

    def draw(self) -> None:
        """Draw the board, as long as there is a screen: the last look may come while it closes."""
        if not self.screen_stack:
            return
        base = self.screen_stack[0]
        for panel in base.query(Panel):
            panel.show(self.board)
        for view in base.query(TraceView):
            view.show(self.board.circle, self._shown_traces(), None if self._centred else self.board.running)
        keys = (self.board.allowed, self.board.state, self.board.fault is None)
        if keys != self._keys:
            self._keys = keys
            self.refresh_bindings()

    def _shown_traces(self) -> Mapping[Direction, LiveTrace | Centred]:
        """Traces as measured, or those of complete circles about their own centre."""
        if not self._centred:
            return self.board.traces
        return {way: trace.centred for way, trace in self.board.traces.items() if trace.centred is not None}

    def _drop_stale_question(self) -> None:
        """Take a question back whose circle has ended meanwhile: an answer to it would hit something else."""
        question = self.screen_stack[-1] if self.screen_stack else None  # none: the last look may come while it closes
        if isinstance(question, GiveUpQuestion):
            running = self.board.state in RECORDING and self.board.announced is not None
            if not running or self.board.announced is None or self.board.announced.run.label != question.run:
                question.dismiss(result=False)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Only keys that mean something now stand in the footer and do something."""
        if action == "tell":
            return type(_COMMANDS[str(parameters[0])]) in self.board.allowed
        if action == "connect":
            return self.board.fault is not None
        return True

    def action_tell(self, name: str) -> None:
        """Send a command, after a question where it gives up a circle that is being recorded."""
        if name in _GIVES_UP and self.board.state in RECORDING:
            self._ask(_GIVES_UP[name], lambda sure: self._tell_if(name, sure=bool(sure)))
        else:
            self._runner.send(_COMMANDS[name])

    def _tell_if(self, name: str, *, sure: bool) -> None:
        if sure:
            self._runner.send(_COMMANDS[name])

    def _ask(self, act: str, then: Callable[[bool | None], None]) -> None:
        """Ask whether to give up the circle; one question at a time."""
        if isinstance(self.screen, GiveUpQuestion):
            return
        run = self.board.announced.run.label if self.board.announced else ""
        self.push_screen(GiveUpQuestion(run, act), then)

    def action_view(self) -> None:
        """Change between the circle as measured and its form about its own centre."""
        self._centred = not self._centred
        self.draw()

    def action_connect(self) -> None:
        """Open instrument and session again after a fault."""
        self._runner.start()

    def action_brightness(self) -> None:
        """Change between dark and light."""
        self.theme = LIGHT if self.theme == DARK else DARK

    def action_leave(self) -> None:
        """Quit, after a question where a circle is being recorded."""
        if self.board.state in RECORDING:
            self._ask("Quit", self.leave)
        else:
            self.leave(sure=True)

    def leave(self, sure: bool | None) -> None:  # noqa: FBT001 - answer of a question
        """End the sequence, if they are sure; the screen closes when it has ended."""
        if not sure:
            return
        self._leaving = True
        if not self._runner.send(Quit()) or self.board.state in FINAL:
            self.exit()
