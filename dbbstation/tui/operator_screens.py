"""An operator's screens: job, set-up, circle and answer."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical, VerticalScroll
from textual.content import Content
from textual.widgets import Static

from dbbstation.service.choice import Choice
from dbbstation.station.states import State
from dbbstation.tui import texts
from dbbstation.tui.board_screen import RunScreen
from dbbstation.tui.footer import KeyFooter
from dbbstation.tui.large_screen import LargeFigures, block_rows, largest
from dbbstation.tui.now_line import OperatorNowLine, ProgressLine, TitleLine, banner
from dbbstation.tui.panel import lines
from dbbstation.tui.questions import TypeQuestion, YesQuestion
from dbbstation.tui.row_screen import ExplainedScreen, FrontScreen
from dbbstation.tui.set_up_panel import set_up

if TYPE_CHECKING:
    from collections.abc import Callable

    from textual.app import ComposeResult
    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.service.choice import Prepared
    from dbbstation.service.front import Front
    from dbbstation.service.operated import Answered, JobAnswer, Operated
    from dbbstation.tui.app import StationApp

_NAME = 16


class JobScreen(FrontScreen):
    """The bottom screen: what is measured, and its few choices."""

    help_name = "job"

    def __init__(self, reception: StationApp, front: Front, operated: Operated) -> None:
        super().__init__(reception, front)
        self._operated = operated
        self._choice = Choice()

    def on_mount(self) -> None:
        self.search()

    def search(self) -> None:
        self.say(texts.START_LOOKS)
        self.do(self._operated.choice, self._found)

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        name = self._rows[self.at]
        if name == _ANEW:
            self.say(texts.START_LOOKS)
            self.do(lambda: self._operated.choice(anew=True), self._found)
            return
        if name == _BEGIN:
            self._begin(self._choice)
            return
        self.app.push_screen(
            TypeQuestion(texts.JOB_ROWS[name], self._value(name)), lambda text: self._typed(name, text)
        )

    @property
    def _rows(self) -> tuple[str, ...]:
        return (_BEGIN, *((_ANEW,) if self._choice.goes_on else ()), *self._operated.job.may_change)

    def _begin(self, choice: Choice) -> None:
        lacking = [texts.JOB_ROWS[name] for name in self._operated.job.required if not self._value(name).strip()]
        if lacking:
            self.say(f"Still required: {', '.join(lacking)}. Choose the row, Enter changes it.", wrong=True)
            return

        def sure(yes: bool | None) -> None:  # noqa: FBT001 - answer of a question
            if yes:
                self.say(texts.NEW_CHECKS)
                self.do(lambda: self._checked(choice), lambda prepared: self._prepared(choice, prepared))

        if self._operated.left_long_ago(choice):
            old = "The session was left before this shift. Ball and holder must stand untouched since."
            self.app.push_screen(YesQuestion(f"{old}\n\nY  they do, go on      N or Esc  back: begin anew"), sure)
        else:
            sure(yes=True)

    def _checked(self, choice: Choice) -> Prepared:
        prepared = self._front.prepare(choice)
        if choice.folder is not None:
            self._operated.tolerances_file(choice.folder)  # a limit that changes from here on is noted
        return prepared

    def _typed(self, name: str, text: str | None) -> None:
        if text is None:
            return
        if name == "port":
            self._choice = replace(self._choice, line=self._choice.line.model_copy(update={"port": text}))
        elif name == "temperature":
            if (degc := self.degc_of(text)) is None:
                return
            self._choice = replace(self._choice, ambient_temp_c=degc)
        else:
            self._choice = replace(self._choice, **{_FIELDS[name]: text})  # type: ignore[arg-type]  # both are texts
        self._show()

    def _value(self, name: str) -> str:
        if name == "port":
            return self._choice.line.port
        if name == "temperature":
            degc = self._choice.ambient_temp_c
            return "" if degc is None else f"{degc:g}"
        return str(getattr(self._choice, _FIELDS[name]))

    def _found(self, choice: Choice) -> None:
        # What was typed for the session before holds for the next: the operator is the same.
        operator = choice.operator if self._choice.folder is None else self._choice.operator
        self._choice = replace(choice, operator=operator)
        self._show()

    def _show(self) -> None:
        job, choice = self._operated.job, self._choice
        begin = "Go on with session" if choice.goes_on else "Begin: session"
        name = "" if choice.folder is None else choice.folder.name
        rows = [Content.styled(f"{begin} {name}", "bold")]
        rows += [Content("Begin anew: leave that session as it is")] if choice.goes_on else []
        rows += [
            Content.assemble(f"{texts.JOB_ROWS[one]:{_NAME}} ", (self._value(one) or texts.UNNAMED, "bold"))
            for one in job.may_change
        ]
        self.banner(virtual=choice.line.virtual)
        self.put(rows)
        self.say(f"{job.name}: Enter begins; a row that may be changed is changed by Enter too.")
        self.about(lines(*(Content(text) for text in self._about())))
        self.refresh_bindings()

    def _about(self) -> list[str]:
        job = self._operated.job
        limits = [
            f"at most {one.largest:g} {one.unit} of {one.quantity.replace('-', ' ')}, {', '.join(one.tests) or 'all tests'}"
            for one in job.tolerances
        ]
        by = f"by {job.instrument} at {job.port}"
        trouble = [f"In trouble: {job.trouble}"] if job.trouble else []
        return [f"{job.plan}, {job.machine}", by, *limits, *trouble, "", "Before you begin:", *texts.CONFIRMED.values()]

    def _prepared(self, choice: Choice, prepared: Prepared) -> None:
        if self.is_current:
            self.say(texts.START_OPENS.format(folder="" if choice.folder is None else choice.folder.name))
            self._reception.open(choice, prepared, self.failed)


_BEGIN, _ANEW = "begin", "anew"
_FIELDS = {"operator": "operator", "order": "job"}
"""Field of the choice that each row changes."""


class OperateScreen(RunScreen):
    """Set-up before a circle, large letters during and after it."""

    help_name = "operate"

    def compose(self) -> ComposeResult:
        yield TitleLine(self._show.plan, id="title")
        yield OperatorNowLine(self._show.trouble)
        with Vertical(id="set-up-view"):
            yield from set_up(self._show.bores, self._clock)
        yield LargeFigures(clock=self._clock, id="circle-view")
        yield ProgressLine(id="progress")
        yield KeyFooter()

    def draw(self) -> None:
        self.set_class(self.desk.board.state in {None, State.BETWEEN, State.ANNOUNCED, State.PAUSED}, "-set-up")
        super().draw()

    def offers_accept(self) -> bool:
        return False

    def offers_tell(self, name: str) -> bool:
        return name not in {"reject", "skip", "accept"} and super().offers_tell(name)


class AnswerScreen(ExplainedScreen):
    """The answer in large letters, with reasons and advice."""

    help_name = "answer"

    BINDINGS: ClassVar[list[BindingType]] = [("enter", "read", "Back"), ("escape,q", "back", "Back")]

    def __init__(self, answer: JobAnswer, back: Callable[[], None], *, virtual: bool = False) -> None:
        super().__init__()
        self._answer, self._back, self._virtual = answer, back, virtual
        self._answered: Answered | None = None

    def compose(self) -> ComposeResult:
        yield Static(banner(virtual=self._virtual) + Content(" dbbstation · Answer"), id="row-title")
        yield Static(Content("The circles are held against the limits …"), id="answer-word")
        with VerticalScroll(id="answer-why", can_focus=False):
            yield Static("", id="answer-text", markup=False)
        yield KeyFooter()

    def on_unmount(self) -> None:
        self._answer.close()

    def on_resize(self) -> None:
        self._draw()

    def look(self) -> None:
        if self._answered is None:
            self._answered = self._answer.look()
            self._draw()
            self.refresh_bindings()

    def offers_read(self) -> bool:
        return self._answered is not None

    def action_read(self) -> None:
        self._back()

    action_back = action_read

    def _draw(self) -> None:
        answered = self._answered
        if answered is None or not self.query("#answer-word"):
            return
        word = str(answered.word).upper()
        wide, high = largest(tuple(texts.ANSWERS), max(self.size.width - 4, 1), max(self.size.height // 3, 5))
        style = texts.CONFORMITY_STYLES[answered.word]
        self.query_one("#answer-word", Static).update(
            lines(
                *(Content.styled(f"  {row}", style) for row in block_rows(word, wide, high)),
                Content.styled(f"  {word}", style),
            )
        )
        told = [*answered.reasons, "", *(f"{place}. {text}" for place, text in enumerate(answered.to_do, start=1))]
        told += ["", f"The report: {answered.report}"] if answered.report is not None else []
        self.query_one("#answer-text", Static).update(Content("\n".join(told)))
