"""All tests on a map of the plate, for choosing another test or verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.binding import Binding
from textual.containers import Horizontal

from dbbstation.quality.answer import Advice
from dbbstation.service.board import RunDecision
from dbbstation.station.commands import GoTo, Judge
from dbbstation.station.states import State
from dbbstation.tui.board_screen import BoardScreen
from dbbstation.tui.footer import KeyFooter
from dbbstation.tui.now_line import TitleLine
from dbbstation.tui.overview_panels import ChosenRun, ChosenTest, LeftLine, PlateMap, TestList
from dbbstation.tui.questions import ReasonQuestion

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.station.events import RunCompleted
    from dbbstation.tui.app import StationApp
    from dbbstation.tui.board_screen import Shown

_VERDICT_BEFORE = {False: RunDecision.ACCEPTED, True: RunDecision.REJECTED}
"""Verdict that a key takes back, by whether the run counts then."""


class OverviewScreen(BoardScreen):
    """Shown over the present screen."""

    help_name = "overview"

    BINDINGS: ClassVar[list[BindingType]] = [
        # The line above the footer says that arrow keys choose.
        Binding("up", "choose(-1)", "Test above", show=False),
        Binding("down", "choose(1)", "Test below", show=False),
        Binding("left", "turn(0)", "First direction", show=False),
        Binding("right", "turn(1)", "Second direction", show=False),
        ("enter", "go_to", "Go to"),
        ("h", "earlier", "Earlier run"),
        ("x", "judge(False)", "Does not count"),
        ("a", "judge(True)", "Counts again"),
        ("o,escape", "dismiss", "Back"),
    ]

    def __init__(self, desk: StationApp, shown: Shown, *, judging: bool = True) -> None:
        super().__init__(desk)
        self._judging = judging
        self._show = shown
        announced = desk.board.announced
        names = list(shown.tests)
        at = names.index(announced.run.test) if announced and announced.run.test in names else 0
        directions = shown.tests[names[at]].directions if names else ()
        way = directions.index(announced.run.direction) if announced and announced.run.direction in directions else 0
        self.choice = ChosenTest(names, at, way)

    def compose(self) -> ComposeResult:
        yield TitleLine(self._show.plan, id="overview-title")
        yield LeftLine(self._show)
        with Horizontal(id="plate-and-tests"):
            yield PlateMap(self._show, self.choice)
            yield TestList(self.choice)
        yield ChosenRun(self._show, self.choice)
        yield KeyFooter()

    def keys(self) -> object:
        run = self._run()
        verdict = self.desk.board.verdicts.get(run.run.label) if run else None
        return super().keys(), self.choice.at, self.choice.way, verdict, len(self._runs())

    def offers_go_to(self) -> bool:
        return GoTo in self.desk.board.allowed and bool(self.choice.tests)

    def offers_earlier(self) -> bool:
        return len(self._runs()) > 1

    def offers_judge(self, accepted: bool) -> bool:  # noqa: FBT001 - as the key has it
        board, run = self.desk.board, self._run()
        return (
            self._judging
            and (Judge in board.allowed or board.state is State.FINISHED)
            and run is not None
            and (run.figures is not None or not accepted)
            and board.verdicts.get(run.run.label) is _VERDICT_BEFORE[accepted]
        )

    def action_choose(self, steps: int) -> None:
        self.choice.back = 0
        self.choice.at = min(max(self.choice.at + steps, 0), max(len(self.choice.tests) - 1, 0))
        self.draw()

    def action_turn(self, way: int) -> None:
        self.choice.way, self.choice.back = way, 0
        self.draw()

    def action_earlier(self) -> None:
        self.choice.back = (self.choice.back + 1) % max(len(self._runs()), 1)
        self.draw()

    def action_go_to(self) -> None:
        self.desk.send(GoTo(self.choice.test, self.choice.direction(self._show)))
        self.dismiss()

    def action_judge(self, accepted: bool) -> None:  # noqa: FBT001 - as the key has it
        completed = self._run()
        if completed is None:
            return
        run = completed.run

        def answered(reason: str | None) -> None:
            if reason is not None:
                self.desk.send(Judge(run.test, run.direction, run.repeat, accepted, reason))

        if accepted and completed.answer.word is not Advice.REPEAT:
            answered("")
        else:
            self.app.push_screen(ReasonQuestion(run.label, counts=accepted), answered)

    def _runs(self) -> tuple[RunCompleted, ...]:
        return self.choice.runs(self.desk.board, self._show)

    def _run(self) -> RunCompleted | None:
        return self.choice.run(self.desk.board, self._show)
