"""A screen that shows the board."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from dbbstation.quality.answer import Advice
from dbbstation.station.commands import Accept, Command, Pause, Reject, Repeat, Resume, Skip, Start
from dbbstation.station.states import RECORDING, VERDICT
from dbbstation.tui.panel import Panel
from dbbstation.tui.questions import GiveUpQuestion, ReasonQuestion
from dbbstation.tui.row_screen import ExplainedScreen

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from textual.binding import BindingType

    from dbbstation.plan.plan import PlannedTest
    from dbbstation.tui.app import StationApp


@dataclass(frozen=True)
class Shown:
    """Plan and plate, and the shop's text for an operator in trouble."""

    plan: str
    bores: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    cell_aspect: float = 2.0
    tests: Mapping[str, PlannedTest] = field(default_factory=dict)
    trouble: str = ""


COMMANDS: dict[str, Command] = {
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
"""Commands that end a running circle, after a question."""


class BoardScreen(ExplainedScreen):
    """A screen whose parts show the board."""

    def __init__(self, desk: StationApp) -> None:
        super().__init__()
        self.desk = desk

    def draw(self) -> None:
        for panel in self.query(Panel):
            panel.show(self.desk.board)
        self.keys_by(self.keys())

    def keys(self) -> object:
        board = self.desk.board
        return board.allowed, board.state, board.fault is None


class RunScreen(BoardScreen):
    """A screen for use at the machine; its keys command the present run."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("enter", "tell('start')", "Start"),
        ("enter", "next", "Next"),
        ("m", "tell('touched')", "Mounting"),
        ("u", "undecided", "Keep"),
        ("z", "alone", "In its place"),
        ("a", "accept", "Accept"),
        ("r", "tell('repeat')", "Repeat"),
        ("x", "tell('reject')", "Reject"),
        ("s", "tell('skip')", "Skip"),
        ("p", "tell('pause')", "Pause"),
        ("p", "tell('resume')", "Go on"),
    ]

    def __init__(self, desk: StationApp, shown: Shown, *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(desk)
        self._show = shown
        self._clock = clock

    def offers_tell(self, name: str) -> bool:
        return type(COMMANDS[name]) in self.desk.board.allowed

    def offers_accept(self) -> bool:
        return Accept in self.desk.board.allowed

    def offers_next(self) -> bool:
        return self.desk.board.state in VERDICT and not self.offers_undecided()

    def offers_alone(self) -> bool:
        completed = self.desk.board.completed
        beside = None if completed is None else completed.counts_beside
        return Accept in self.desk.board.allowed and beside is not None and not self._faulty

    @property
    def _faulty(self) -> bool:
        completed = self.desk.board.completed
        return completed is None or completed.answer.word is Advice.REPEAT

    def offers_undecided(self) -> bool:
        board = self.desk.board
        if Accept not in board.allowed or board.completed is None or board.doubted:
            return False
        return board.completed.answer.word is Advice.CANNOT_TELL

    def keys(self) -> object:
        return super().keys(), self.offers_undecided(), bool(self.desk.board.doubted)

    def action_next(self) -> None:
        """Accept or repeat the run as its verdict suggests, then return to runs in doubt."""
        back = bool(self.desk.board.doubted)
        self.desk.send(Repeat(back=back) if self._faulty else Accept(back=back))

    def action_undecided(self) -> None:
        """Accept a run in which some faults are undetectable."""
        completed = self.desk.board.completed
        if completed is not None:
            self.desk.send(Accept(f"not to be seen: {', '.join(completed.answer.unseen)}"))

    def action_alone(self) -> None:
        self.desk.send(Accept(alone=True))

    def action_accept(self) -> None:
        """Accept the run; a faulty run needs a reason."""
        completed = self.desk.board.completed
        if completed is None or completed.answer.word is not Advice.REPEAT:
            self.desk.send(Accept())
            return

        def answered(reason: str | None) -> None:
            if reason and self.desk.board.completed is completed:
                self.desk.send(Accept(reason))

        self.app.push_screen(ReasonQuestion(completed.run.label, counts=True), answered)

    def action_tell(self, name: str) -> None:
        def answered(sure: bool | None) -> None:  # noqa: FBT001 - answer of a question
            if sure:
                self.desk.send(COMMANDS[name])

        if name in _GIVES_UP and self.desk.board.state in RECORDING:
            ask_to_give_up(self, _GIVES_UP[name], answered)
        else:
            answered(sure=True)


def ask_to_give_up(screen: BoardScreen, act: str, then: Callable[[bool | None], None]) -> None:
    """Ask whether to give up the recording; only one question is open at a time."""
    if isinstance(screen.app.screen, GiveUpQuestion):
        return
    announced = screen.desk.board.announced
    screen.app.push_screen(GiveUpQuestion(announced.run.label if announced else "", act), then)
