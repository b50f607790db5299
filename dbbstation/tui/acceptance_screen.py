"""Acceptance: compare circles before and now with the shop's tolerances, and name the former models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from textual.content import Content

from dbbstation.computing.threads import in_background
from dbbstation.errors import StationError
from dbbstation.facts.serialise import as_objects
from dbbstation.quality.conformity import Conformity
from dbbstation.service.former_sessions import before_and_now
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.tui import texts
from dbbstation.tui.panel import cut, lines
from dbbstation.tui.questions import ChooseQuestion
from dbbstation.tui.row_screen import RowScreen
from dbbstation.tui.sentences import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future
    from pathlib import Path

    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.facts.held import HeldTolerance, ToleranceOfTest, WorstCircle
    from dbbstation.service.after import After, Result
    from dbbstation.service.former_sessions import BeforeAndNow, Former, InForce


_WIDE = 12
"""Width of the column of test names."""


def _row(test: str, figure: str, before: str, now: str, limit: str, expanded: str) -> str:
    return f"{test:{_WIDE}}  {figure:18} {before:>6} {now:>6} {limit:>6} {expanded:>5}  "


HEADING = _row("test", "worst figure, µm", "before", "now", "limit", "U k=2") + "verdict"

_DIGEST = 8
"""Number of shown digits of a SHA-256, which people only compare."""


def test_line(one: ToleranceOfTest) -> Content:
    """Return the row of one figure of a test: its worst circle before and now, limit, U, and verdict."""
    name, expanded = texts.FIGURE_NAMES[one.quantity], _expanded(one.worst)
    row = _row(cut(one.test, _WIDE), name, _um(one.before), _um(one), f"{one.largest_um:g}", expanded)
    conformity = Conformity(one.conformity or Conformity.UNDECIDED)
    return Content.assemble(row, (texts.CONFORMITY_WORDS[conformity], texts.CONFORMITY_STYLES[conformity]))


def worst_lines(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    """Yield a sentence for each tolerance: the worst circle before and now, or what is missing."""
    told = [(one, one.worst) for one in answer.tolerances if one.worst is not None]
    for one, worst in told:
        before = texts.NOT_BEFORE if one.before is None or one.before.worst is None else _circle(one.before.worst)
        word = texts.CONFORMITY_WORDS[one.conformity or Conformity.UNDECIDED]
        name, limit = texts.FIGURE_NAMES[one.quantity], f"at most {one.largest_um:g} µm"
        yield f"{name}: before {before}; now {_circle(worst)}; {limit}: {word}."
    if not told:
        yield from (answer.verdict.headline, *answer.verdict.to_do)


def in_force_line(in_force: InForce) -> str:
    """Return the programs that commanded the circles of a session, in words."""
    if in_force.compensated == 0:
        return "nominal programs" if in_force.programs else "the control's own circles"
    if in_force.compensated < in_force.circles:
        return f"compensated programs for {in_force.compensated} of {in_force.circles} only"
    return "compensated programs"


def way_back_lines(former: Former, kept: tuple[Path, ...]) -> Iterator[str]:
    """Yield lines on the files of the former models."""
    in_force = former.in_force
    if in_force.compensated == 0:
        yield f"Way back: before, nothing was compensated; machine and plan lie in {former.folder}."
    for path in kept:
        yield f"Way back: the model in force before is kept in {path}."
    for sha256 in in_force.lost:
        yield f"Way back: the model with SHA-256 {sha256[:_DIGEST]}… was in force before and lies nowhere beside the sessions."
    if in_force.programs is not None:
        yield f"Way back: the programs that ran before lie in {in_force.programs}."


def _circle(worst: WorstCircle) -> str:
    return f"{worst.um:.1f} µm, U {_expanded(worst)} µm ({worst.test} {worst.direction} {worst.repeat})"


def _expanded(worst: WorstCircle | None) -> str:
    u_um = None if worst is None else worst.expanded_um
    return texts.NOT_BEFORE if u_um is None else f"{u_um:.1f}"


def _um(held: HeldTolerance | None) -> str:
    return texts.NOT_BEFORE if held is None or held.worst is None else f"{held.worst.um:.1f}"


class AcceptanceScreen(RowScreen):
    """Shown over the results."""

    help_name = "acceptance"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("h", "former", "Session before"),
        ("k", "cancel", "End"),
        ("escape,q", "dismiss", "Back"),
    ]

    def __init__(self, after: After, search: Callable[[Path], BeforeAndNow] = before_and_now) -> None:
        super().__init__()
        self._after, self._search = after, search
        self._searching: Future[BeforeAndNow] | None = None
        self._found: BeforeAndNow | None = None
        self._failure = ""

    def on_mount(self) -> None:
        self._searching = in_background(lambda: self._search(self._after.session))
        self._draw()

    def look(self) -> None:
        if self._searching is not None and self._searching.done():
            searching, self._searching = self._searching, None
            try:
                self._found = searching.result()
            except (StationError, OSError) as error:
                self._failure = str(error)
        self._after.look()
        self._draw()

    def offers_former(self) -> bool:
        return self._after.busy is None and self._found is not None and bool(self._found.formers)

    def offers_cancel(self) -> bool:
        return self._after.busy is SessionTask.ACCEPTANCE

    def chosen_another(self) -> None:
        self._draw()

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        if self._after.former is None and self.offers_former():
            self._accept(self.at)

    def action_former(self) -> None:
        if self._found is not None:
            title = "Hold this session against which one before? Arrow keys, Enter; Esc goes back."
            self.app.push_screen(ChooseQuestion(title, self._offered()), self._accept)

    def action_cancel(self) -> None:
        self._after.cancel()

    def _offered(self) -> list[str]:
        formers = self._found.formers if self._found is not None else ()
        return [
            f"{one.folder.name:20} {one.measured.astimezone():%Y-%m-%d %H:%M}  {in_force_line(one.in_force)}"
            for one in formers
        ]

    def _accept(self, place: int | None) -> None:
        if place is None or self._found is None or place >= len(self._found.formers):
            return
        self._failure = ""
        try:
            self._after.accept(self._found.formers[place])
        except (StationError, OSError) as error:
            self._failure = str(error)
        self._draw()

    def _draw(self) -> None:
        if not self.stands:
            return
        told = self._after.results[SessionTask.ACCEPTANCE].answer
        answer = as_objects(told) if told else None
        sentence, wrong = self._sentence()
        self.say(sentence, wrong=wrong)
        tests = () if answer is None else answer.tolerances_by_test
        if self._after.former is None:
            self.put([Content(label) for label in self._offered()])
            ran = "" if self._found is None else texts.RUN_BY_NOW.format(by=in_force_line(self._found.now))
            self.about(Content(ran))
        else:
            self.put([Content.styled(HEADING, "dim"), *(test_line(one) for one in tests)])
            self.about(lines(*self._notes(answer)))
        self.keys_by((self._after.busy, self._found, self._after.former))

    def _sentence(self) -> tuple[str, bool]:
        result = self._after.results[SessionTask.ACCEPTANCE]
        if self._failure:
            return self._failure, True
        if self._after.former is not None and result.progress is not None:
            return self._compared(result)
        if self._after.busy is not None:
            return "Another step is being done; the acceptance can begin when that has ended.", False
        if self._found is None:
            return "Looking for sessions measured before …", False
        return (
            "Choose the session measured before: Enter. Then both are held against the shop's tolerances."
            if self._found.formers
            else "No session of the same machine, plan and jig beside this one ended before it began: there is nothing to compare.",
            False,
        )

    @staticmethod
    def _compared(result: Result) -> tuple[str, bool]:
        match result.progress:
            case WorkProgress.DONE:
                kind = as_objects(result.answer).verdict.kind
                return texts.ACCEPTANCE_VERDICT[kind], kind == "exceeded"
            case WorkProgress.FAILED:
                return result.failure, True
            case WorkProgress.CANCELLED:
                return "Ended before it was done; nothing of it was written. B chooses a session before.", False
        stage = result.stage or texts.STEP_BEGINS
        return f"Comparing: {stage} ({duration(result.passed_s)}). X ends it.", False

    def _notes(self, answer: Any) -> list[Content]:  # noqa: ANN401 - a result as objects, or None
        after = self._after
        told = [] if answer is None else [Content(text) for text in worst_lines(answer)]
        if self._found is not None:
            now = self._found.now
            style = "" if now.compensated == now.circles else "$text-warning"
            told.append(Content.styled(texts.RUN_BY_NOW.format(by=in_force_line(now)), style))
        if after.former is not None:
            told += [Content(text) for text in way_back_lines(after.former, after.kept)]
        path = after.results[SessionTask.ACCEPTANCE].path
        return [*told, *([] if path is None else [Content.styled(str(path), "bold")])]
