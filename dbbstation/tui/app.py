"""The app of the station: takes what happened, has the screen on top drawn, passes on what is pressed."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, ClassVar, Protocol

from textual.app import App, SystemCommand
from textual.binding import Binding
from textual.screen import ModalScreen

from dbbstation.service.board import Board
from dbbstation.station.commands import Command, Quit
from dbbstation.station.states import FINAL, RECORDING, VERDICT
from dbbstation.tui.board_screen import BoardScreen, ask_to_give_up
from dbbstation.tui.help_screen import HelpScreen
from dbbstation.tui.large_screen import LargeScreen
from dbbstation.tui.measure_screen import MeasureScreen
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.question import GiveUpQuestion
from dbbstation.tui.shown import Shown
from dbbstation.tui.texts import HELP

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from textual.binding import BindingType
    from textual.screen import Screen

    from dbbstation.service.board import SequenceOpened
    from dbbstation.station.events import Event

__all__ = ["DARK", "LIGHT", "LOOK_S", "Sequence", "Shown", "StationApp"]

LOOK_S = 0.1
"""Between looks into the mailbox [s]: ten pictures per second are fluent, more is work that nobody sees."""

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


class StationApp(App[None]):
    """Screens on one board.

    Args:
        shown: plan and plate.
        runner: runs the sequence; started when the screen stands.
        clock: real time, for telling an old reading [s].
    """

    TITLE = "dbbstation"
    ENABLE_COMMAND_PALETTE = True
    VERTICAL_BREAKPOINTS = [(0, "-low"), (_TALL_ROWS, "-tall")]  # noqa: RUF012 - declared by Textual, as an attribute of instances
    BINDINGS: ClassVar[list[BindingType]] = [
        ("o", "overview", "Tests"),
        ("f", "large", "Large"),
        ("c", "connect", "Connect again"),
        Binding("d", "brightness", "Dark/light", show=False),
        ("f1,question_mark", "explain", "Help"),
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
        self._leaving = False

    def get_default_screen(self) -> MeasureScreen:
        """Return the screen at the bottom of the stack."""
        return MeasureScreen(self, self._show, clock=self._clock)

    def on_ready(self) -> None:
        """Begin to measure, and to look, once every part stands."""
        self._runner.start()
        self.set_interval(LOOK_S, self.look)

    def on_unmount(self) -> None:
        """Whatever closed the screen, the sequence ends in order."""
        self._runner.close()

    def look(self) -> None:
        """Take the mail and draw what changed."""
        before = self.board.state
        alive = self._runner.alive  # asked before its mail is taken: what it sends last is then shown
        for event in self._runner.mail():
            self.board.take(event)
        if self.board.state in VERDICT and before not in VERDICT:
            self.bell()
        self._drop_stale_question()
        self.draw()
        if self._runner.crash is not None or (self._leaving and not alive):
            self.exit()

    @property
    def drawn(self) -> BoardScreen | None:
        """The topmost screen that shows the board; questions and help only stand before it."""
        return next((screen for screen in reversed(self.screen_stack) if isinstance(screen, BoardScreen)), None)

    def draw(self) -> None:
        """Draw the board, as long as there is a screen: the last look may come while it closes."""
        drawn = self.drawn
        if drawn is not None and drawn.is_mounted:
            drawn.draw()

    def send(self, command: Command) -> None:
        """Pass a command on to the sequence."""
        self._runner.send(command)

    def _drop_stale_question(self) -> None:
        """Take a question back whose circle has ended meanwhile: an answer to it would hit something else."""
        question = self.screen_stack[-1] if self.screen_stack else None  # none: the last look may come while it closes
        if isinstance(question, GiveUpQuestion):
            running = self.board.state in RECORDING and self.board.announced is not None
            if not running or self.board.announced is None or self.board.announced.run.label != question.run:
                question.dismiss(result=False)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Only keys that mean something now stand in the footer and do something."""
        if action == "connect":
            return self.board.fault is not None
        if action == "command_palette":
            return not isinstance(self.screen, ModalScreen)
        if action in {"overview", "large"}:
            return not isinstance(self.drawn, OverviewScreen)
        return super().check_action(action, parameters)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        """Offer what the keys of a screen do now, with the sentence that help has for each."""
        if not isinstance(screen, BoardScreen):
            return
        for key, active in screen.active_bindings.items():
            sentence = HELP[screen.help_name].keys.get(key, HELP["everywhere"].keys.get(key))
            if active.enabled and sentence is not None:

                def act(action: str = active.binding.action, node: object = active.node) -> None:
                    self.call_later(self.run_action, action, node)

                yield SystemCommand(active.binding.description, sentence, act)

    def action_overview(self) -> None:
        """Open the overview."""
        self.push_screen(OverviewScreen(self, self._show))

    def action_large(self) -> None:
        """Change between the screen beside the machine and large figures."""
        if isinstance(self.drawn, LargeScreen):
            self.pop_screen()
        else:
            self.push_screen(LargeScreen(self, self._show, clock=self._clock))

    def action_explain(self) -> None:
        """Say what the screen shows and what each key does."""
        if self.drawn is not None:
            self.push_screen(HelpScreen(self.drawn.help_name))

    def action_connect(self) -> None:
        """Open instrument and session again after a fault."""
        self._runner.start()

    def action_brightness(self) -> None:
        """Change between dark and light."""
        self.theme = LIGHT if self.theme == DARK else DARK

    def action_leave(self) -> None:
        """Quit, after a question where a circle is being recorded."""
        if self.board.state in RECORDING and self.drawn is not None:
            ask_to_give_up(self.drawn, "Quit", self.leave)
        else:
            self.leave(sure=True)

    def leave(self, sure: bool | None) -> None:  # noqa: FBT001 - answer of a question
        """End the sequence, if they are sure; the screen closes when it has ended."""
        if not sure:
            return
        self._leaving = True
        if not self._runner.send(Quit()) or self.board.state in FINAL:
            self.exit()
