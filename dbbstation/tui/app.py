"""The station's app: it processes events, draws the top screen, and passes keys on."""

from __future__ import annotations

import time
from concurrent.futures import Future, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual.app import App, SystemCommand
from textual.binding import Binding
from textual.events import InputEvent, Paste
from textual.screen import ModalScreen

from dbbstation.computing.threads import in_background
from dbbstation.errors import StationError
from dbbstation.service.after import After
from dbbstation.service.board import Board, Message, Weight
from dbbstation.service.live_trace import last_traces
from dbbstation.service.operated import JobAnswer
from dbbstation.service.session_notes import add_note, give_verdict, shop_degc
from dbbstation.station.commands import AddNote, Command, Judge, Quit
from dbbstation.station.events import Noted
from dbbstation.station.states import FINAL, RECORDING, VERDICT, State
from dbbstation.tui.board_screen import BoardScreen, Shown, ask_to_give_up
from dbbstation.tui.help_screen import HELP, HelpScreen
from dbbstation.tui.large_screen import LargeScreen
from dbbstation.tui.measure_screen import MeasureScreen
from dbbstation.tui.messages_screen import MessagesScreen
from dbbstation.tui.operator_screens import AnswerScreen, JobScreen, OperateScreen
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.plain_terminal import plain_driver, show_controls
from dbbstation.tui.questions import GiveUpQuestion, TemperatureQuestion, TypeQuestion
from dbbstation.tui.results_screen import ResultsScreen
from dbbstation.tui.row_screen import ExplainedScreen, RowScreen
from dbbstation.tui.start_screen import StartScreen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from textual.binding import BindingType
    from textual.driver import Driver
    from textual.events import Event as ScreenEvent
    from textual.screen import Screen

    from dbbstation.plan.plan import Direction
    from dbbstation.service.choice import Choice, Prepared
    from dbbstation.service.front import Front, Opened
    from dbbstation.service.live_trace import LiveTrace
    from dbbstation.service.operated import Operated
    from dbbstation.service.runner import Runner

__all__ = ["DARK", "LIGHT", "LOOK_S", "Shown", "StationApp"]

LOOK_S = 0.1
"""Interval of the polls of the mailbox [s]: ten pictures per second look fluent."""

_TALL_ROWS = 32
"""Least number of rows for optional parts of a screen."""

DARK, LIGHT = "textual-dark", "textual-light"

_NOT_OPERATED = {"large": "f", "results": "e", "temperature": "t", "command_palette": "ctrl+p"}
"""Actions that are closed to an operator of a job, and their keys."""


class StationApp(App[None]):
    """Screens on one board.

    Args:
        shown: None: the start screen chooses the measurement.
        front: finds sessions and opens jobs; None: only `runner`.
        operated: the operator's one job; None: no restriction.
    """

    TITLE = "dbbstation"
    CSS_PATH = "station.tcss"
    ENABLE_COMMAND_PALETTE = True
    VERTICAL_BREAKPOINTS = [(0, "-low"), (_TALL_ROWS, "-tall")]  # noqa: RUF012 - declared by Textual, as an attribute of instances
    BINDINGS: ClassVar[list[BindingType]] = [
        ("o", "overview", "Tests"),
        ("f", "large", "Large"),
        ("c", "connect", "Connect again"),
        Binding("j", "messages", "Messages", show=False),
        # The sentence at the end of the plan names it; until then the footer has no room.
        Binding("e", "results", "Results", show=False),
        Binding("t", "temperature", "Temperature", show=False),
        Binding("plus", "note", "Note", show=False),
        Binding("d", "brightness", "Dark/light", show=False),
        ("f1,question_mark", "explain", "Help"),
        ("q", "leave", "Quit"),
        # Textual's own meaning of these keys would close the screen without a question, or copy text.
        Binding("ctrl+c,ctrl+q", "leave", show=False, priority=True),
    ]

    def __init__(
        self,
        shown: Shown | None,
        runner: Runner | None,
        *,
        clock: Callable[[], float] = time.monotonic,
        front: Front | None = None,
        operated: Operated | None = None,
    ) -> None:
        show_controls()
        super().__init__()
        self._clock = clock
        self.board = Board()
        self._show = shown or Shown("")
        self._runner = runner
        self._front = front
        self._operated = operated
        self._answering = False
        self._leaving = self._opening = self._wholly = False
        self._works: list[tuple[Future[Any], Callable[[Any], None], Callable[[Exception], None]]] = []
        self._after: dict[Path, After] = {}
        self._looked_up: tuple[Path, str] | None = None

    def get_driver_class(self) -> type[Driver]:
        return plain_driver(super().get_driver_class())

    def get_default_screen(self) -> MeasureScreen | StartScreen | JobScreen:
        if self._operated is not None and self._front is not None:
            return JobScreen(self, self._front, self._operated)
        if self._runner is None and self._front is not None:
            return StartScreen(self, self._front)
        return MeasureScreen(self, self._show, clock=self._clock)

    def on_ready(self) -> None:
        if self._runner is not None:
            self._runner.start()
        self.set_interval(LOOK_S, self.look)

    async def on_event(self, event: ScreenEvent) -> None:
        if self.screen_stack or not isinstance(event, InputEvent | Paste):
            await super().on_event(event)

    def on_unmount(self) -> None:
        if self._runner is not None:
            self._runner.close()
        for after in self._after.values():
            after.close()
        wait([work for work, _, _ in self._works])
        if self._front is not None:
            self._front.close()

    def look(self) -> None:
        if self.screen_stack:  # none: the last look may come while it closes
            self._finish_works()
        for screen in reversed(self.screen_stack):
            if isinstance(screen, ExplainedScreen) and screen.is_mounted:
                screen.look()
                break
        if self._runner is not None:
            self._take_mail(self._runner)

    def _take_mail(self, runner: Runner) -> None:
        before = self.board.state
        alive = runner.alive  # asked before its mail is taken: what it sends last is then shown
        for event in runner.mail():
            self.board.take(event)
        if self.board.state in VERDICT and before not in VERDICT:
            self.bell()
        self._look_up_last()
        self._drop_stale_question()
        self.draw()
        if self.board.finished is not None and self._operated is not None and not self._answering:
            self._answer_job(self._operated)
        if runner.crash is not None:
            self.exit()
        elif self._leaving and not alive:
            self._end()

    def _note_fault(self, error: Exception) -> None:
        self.board.messages.append(Message(Weight.FAULT, str(error)))

    def _answer_job(self, operated: Operated) -> None:
        self._answering = True
        folder = Path(self.board.session)
        missing = self.board.finished.missing if self.board.finished is not None else ()

        def show(answer: JobAnswer) -> None:
            self.push_screen(AnswerScreen(answer, lambda: self.leave(sure=True), virtual=self.board.virtual))

        def work_out() -> None:
            self.do(lambda: JobAnswer(operated, folder, missing), show, self._note_fault)

        if self.board.temperature_due and "temperature" in operated.job.may_change:
            self._ask_temperature(work_out, back=work_out)
        else:
            work_out()

    @property
    def crash(self) -> Exception | None:
        return None if self._runner is None else self._runner.crash

    def _look_up_last(self) -> None:
        board, folder = self.board, Path(self.board.session)
        if not board.session or not board.test or self._looked_up == (folder, board.test):
            return
        test = board.test
        self._looked_up = folder, test

        def found(traces: Mapping[Direction, LiveTrace]) -> None:
            board.last = traces

        # What is wrong with the session itself, the sequence says.
        self.do(lambda: last_traces(folder, test), found, lambda _error: None)

    def _finish_works(self) -> None:
        done = [one for one in self._works if one[0].done()]
        self._works = [one for one in self._works if not one[0].done()]
        for work, then, failed in done:
            try:
                outcome = work.result()
            except (StationError, OSError, ValueError) as error:
                failed(error)
            else:
                then(outcome)

    def do(self, work: Callable[[], Any], then: Callable[[Any], None], failed: Callable[[Exception], None]) -> None:
        self._works.append((in_background(work), then, failed))

    def open(self, choice: Choice, prepared: Prepared, failed: Callable[[Exception], None]) -> None:
        """Open a job in the background and show its screen. Only one job can be open."""
        front = self._front
        if front is None or self._opening:
            return
        self._opening = True

        def begin() -> Opened:
            return front.open(choice, prepared)

        def refused(error: Exception) -> None:
            self._opening = False
            failed(error)

        self.do(begin, self._measure, refused)

    def _measure(self, opened: Opened) -> None:
        self._opening = False
        plan = opened.prepared.job.plan
        trouble = "" if self._operated is None else self._operated.job.trouble
        self._show = Shown(plan.name, plan.plate.bores, tests=plan.to_domain().tests, trouble=trouble)
        self.board, self._runner, self._leaving = Board(), opened.runner, False
        self._answering = False
        self._back_to_start()
        beside = MeasureScreen if self._operated is None else OperateScreen
        self.push_screen(beside(self, self._show, clock=self._clock))
        opened.runner.start()

    def _back_to_start(self) -> None:
        while not isinstance(self.screen, StartScreen | JobScreen):
            self.pop_screen()

    def _end(self) -> None:
        self._leaving = False
        start = self.screen_stack[0] if self.screen_stack else None
        if (
            self._wholly
            or self._front is None
            or self._runner is None
            or not isinstance(start, StartScreen | JobScreen)
        ):
            self.exit()
            return
        self._front.close()
        self._runner, self.board = None, Board()
        self._back_to_start()
        start.search()

    def show_results(self, folder: Path) -> None:
        known = self._after.get(folder)
        if known is not None and known.busy is None and known.outdated:
            known.close()
            del self._after[folder]
        if folder not in self._after:
            self._after[folder] = After(folder) if self._front is None else self._front.after(folder)
        self.push_screen(ResultsScreen(self._after[folder]))

    @property
    def drawn(self) -> BoardScreen | None:
        return next((screen for screen in reversed(self.screen_stack) if isinstance(screen, BoardScreen)), None)

    def draw(self) -> None:
        drawn = self.drawn
        if drawn is not None and drawn.is_mounted:
            drawn.draw()

    def send(self, command: Command) -> None:
        """Send a command to the sequence. Verdicts are also possible after its end."""
        if isinstance(command, Judge) and self.board.state is State.FINISHED:
            self._judge_afterwards(command)
        elif self._runner is not None:
            self._runner.send(command)

    def _judge_afterwards(self, command: Judge) -> None:
        def written(runner: Runner) -> None:
            word = "accepted" if command.accepted else "rejected"
            why = f": {command.reason}" if command.reason else ""
            self.board.messages.append(Message(Weight.NOTE, f"{command.label} {word}{why}"))
            runner.start()

        self._write_afterwards(lambda folder: give_verdict(folder, command), written)

    def _write_afterwards(self, write: Callable[[Path], object], written: Callable[[Runner], None]) -> None:
        runner, folder = self._runner, Path(self.board.session)
        if runner is None:
            return

        def work() -> Runner:
            runner.wait()
            write(folder)
            return runner

        self.do(work, written, self._note_fault)

    def _drop_stale_question(self) -> None:
        question = self.screen_stack[-1] if self.screen_stack else None  # none: the last look may come while it closes
        if isinstance(question, GiveUpQuestion):
            running = self.board.state in RECORDING and self.board.announced is not None
            if not running or self.board.announced is None or self.board.announced.run.label != question.run:
                question.dismiss(result=False)

    @property
    def _measuring(self) -> bool:
        top = self.screen_stack[-1] if self.screen_stack else None  # none while it closes
        return self._runner is not None and not isinstance(top, RowScreen | AnswerScreen)

    def check_action(  # noqa: PLR0911 - a line per action, nothing nested
        self, action: str, parameters: tuple[object, ...]
    ) -> bool | None:
        if self._operated is not None and action in _NOT_OPERATED:
            return False
        if action == "connect":
            return self.board.fault is not None and self._measuring
        if action == "messages":
            return self._measuring and not isinstance(self.screen_stack[-1], ModalScreen)
        if action in {"temperature", "note"}:
            return self._measuring and bool(self.board.session)
        if action == "results":
            return self._measuring and bool(self.board.session) and self.board.state not in RECORDING
        if action == "command_palette":
            return bool(self.screen_stack) and not isinstance(self.screen_stack[-1], ModalScreen)
        if action in {"overview", "large"}:
            return self._measuring and not (action == "overview" and isinstance(self.drawn, OverviewScreen))
        return super().check_action(action, parameters)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        if not isinstance(screen, ExplainedScreen):
            return
        for key, active in screen.active_bindings.items():
            sentence = HELP[screen.help_name].keys.get(key, HELP["everywhere"].keys.get(key))
            if active.enabled and sentence is not None:

                def act(action: str = active.binding.action, node: object = active.node) -> None:
                    self.call_later(self.run_action, action, node)

                yield SystemCommand(active.binding.description, sentence, act)

    def action_overview(self) -> None:
        self.push_screen(OverviewScreen(self, self._show, judging=self._operated is None))

    def action_large(self) -> None:
        before = self.drawn
        if isinstance(before, LargeScreen | OverviewScreen):
            self.pop_screen()
        if not isinstance(before, LargeScreen) and not isinstance(self.drawn, LargeScreen):
            self.push_screen(LargeScreen(self, self._show, clock=self._clock))

    def action_explain(self) -> None:
        explained = next((each for each in reversed(self.screen_stack) if isinstance(each, ExplainedScreen)), None)
        if explained is not None and not isinstance(self.screen, ModalScreen):
            without = () if self._operated is None else _NOT_OPERATED.values()
            self.push_screen(HelpScreen(explained.help_name, tuple(without)))

    def action_messages(self) -> None:
        self.push_screen(MessagesScreen(list(self.board.messages)))

    def action_connect(self) -> None:
        if self._runner is not None:
            self._runner.start()

    def action_temperature(self) -> None:
        self._ask_temperature(lambda: None)

    def action_results(self) -> None:
        folder = Path(self.board.session)
        if self.board.finished is not None and self.board.temperature_due:
            self._ask_temperature(lambda: self.show_results(folder))
        else:
            self.show_results(folder)

    def action_note(self) -> None:
        def answered(text: str | None) -> None:
            if text:
                self._note(text, None, lambda: None)

        self.push_screen(TypeQuestion("A note for the session:"), answered)

    def action_brightness(self) -> None:
        self.theme = LIGHT if self.theme == DARK else DARK

    def action_leave(self) -> None:
        if self._runner is None:
            self.exit()
        elif self.board.state in RECORDING and self.drawn is not None:
            ask_to_give_up(self.drawn, "Quit", self.leave)
        elif self.board.temperature_due and self.board.fault is None and not self._leaving and self._operated is None:
            self._ask_temperature(lambda: self.leave(sure=True))
        else:
            self.leave(sure=True)

    def _ask_temperature(self, then: Callable[[], None], back: Callable[[], None] = lambda: None) -> None:
        """Ask for the shop's temperature, note it, then continue; only one question is open at a time."""
        if isinstance(self.screen, TemperatureQuestion):
            return

        def answered(text: str | None) -> None:
            degc = shop_degc(text or "")
            if text is None:
                back()
            elif degc is None:
                then()
            else:
                self._note("", degc, then)

        self.push_screen(TemperatureQuestion(), answered)

    def _note(self, text: str, degc: float | None, then: Callable[[], None]) -> None:
        """Note a text or a temperature [degC] through the sequence, or in the file after the sequence's end."""
        if self._runner is None or AddNote in self.board.allowed:
            self.send(AddNote(text, degc))
            then()
            return

        def written(_: Runner) -> None:
            self.board.take(Noted(text, degc))
            then()

        self._write_afterwards(lambda folder: add_note(folder, text, degc), written)

    def close_down(self) -> None:
        self._wholly = True
        self.leave(sure=True)

    def give_up(self) -> None:
        """End the sequence from another thread if the screen does not respond."""
        if self._runner is not None:
            self._runner.close()

    def leave(self, sure: bool | None) -> None:  # noqa: FBT001 - answer of a question
        """End the sequence if sure; the screen closes afterwards."""
        if not sure:
            return
        if self._runner is None:
            self.exit()
            return
        self._leaving = True
        if not self._runner.send(Quit()) or self.board.state in FINAL:
            self._end()
