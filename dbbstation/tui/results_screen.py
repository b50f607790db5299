"""Tasks after a session and their results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from textual.binding import Binding
from textual.content import Content
from textual.widgets import OptionList

from dbbstation.facts.serialise import as_objects
from dbbstation.report.history_words import changes_in_words, headline
from dbbstation.results.levels_text import bars
from dbbstation.results.words import (
    ending_sentences,
    fit_sentences,
    mismatch_sentence,
    outlier_sentence,
    residual_lines,
    use_sentence,
    visibility_sentences,
)
from dbbstation.service.after import USUAL
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.tui import texts
from dbbstation.tui.acceptance_screen import AcceptanceScreen, worst_lines
from dbbstation.tui.panel import lines
from dbbstation.tui.questions import YesQuestion
from dbbstation.tui.row_screen import RowScreen
from dbbstation.tui.sentences import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from textual.binding import BindingType

    from dbbstation.service.after import After, Result


_MOST = 6
"""Greatest number of shown causes, and of shown sentences of a kind; the files contain all."""


def result_lines(step: SessionTask, answer: Mapping[str, object]) -> list[str]:
    """Return the main results of a step's JSON."""
    return list(_LINES[step](as_objects(answer)))


def _calibrated(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield use_sentence(answer)
    yield from residual_lines(answer)
    yield from fit_sentences(answer)
    yield from (outlier_sentence(one) for one in answer.outliers[:_MOST])
    yield from visibility_sentences(answer)


def _diagnosed(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield from answer.said
    yield from bars(answer.levels, "µm")
    yield mismatch_sentence(answer)
    for verdict, words in texts.VERDICT_WORDS.items():
        names = [cause.name for cause in answer.sources if cause.verdict == verdict]
        if names:
            yield f"{words}: {', '.join(names)}"
    yield answer.unexplained.text
    yield from ending_sentences(answer)


def _programmed(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield f"{len(answer.programs)} programs for {answer.dialect}, all within the machine's travel."
    greatest = [one.greatest_correction_um for one in answer.programs if one.greatest_correction_um is not None]
    if greatest:
        yield f"The greatest correction is {max(greatest):.1f} µm."


def _reported(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    verdict = answer.verdict
    yield texts.REPORT_VERDICT[verdict.kind]
    yield verdict.headline
    yield from verdict.reasons[:_MOST]
    yield from verdict.to_do[:_MOST]


def _accepted(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield texts.ACCEPTANCE_VERDICT[answer.verdict.kind]
    yield from worst_lines(answer)


def _drawn(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield f"{sum(hasattr(run, 'g_um') for run in answer.runs)} circles are drawn."


def _over_time(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    for machine in answer.machines[:_MOST]:
        yield f"{machine.machine}: {headline(machine)}"
        yield from list(changes_in_words(machine, answer.coverage_factor))[:_MOST]


_LINES: dict[SessionTask, Callable[[Any], Iterator[str]]] = {
    SessionTask.CALIBRATE: _calibrated,
    SessionTask.DIAGNOSE: _diagnosed,
    SessionTask.PROGRAMS: _programmed,
    SessionTask.REPORT: _reported,
    SessionTask.ACCEPTANCE: _accepted,
    SessionTask.FIGURES: _drawn,
    SessionTask.HISTORY: _over_time,
}


STEPS = tuple(SessionTask)


class ResultsScreen(RowScreen):
    """Shown over the sessions or the measuring screen."""

    help_name = "results"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("0", "every", "All"),
        ("1", "step('calibrate')", "Calibrate"),
        ("2", "step('diagnose')", "Diagnose"),
        ("3", "step('programs')", "Programs"),
        ("4", "step('report')", "Report"),
        ("5", "acceptance", "Acceptance"),
        # The rows above name their keys; in the footer of a small terminal there is no room for them.
        Binding("6", "step('figures')", "Figures", show=False),
        Binding("7", "step('history')", "History", show=False),
        ("k", "cancel", "End"),
        ("escape,q", "back", "Back"),
    ]

    def __init__(self, after: After) -> None:
        super().__init__()
        self._after = after

    def on_mount(self) -> None:
        self._draw()

    def look(self) -> None:
        busy = self._after.busy
        self._after.look()
        if self._after.busy is not busy and busy is not None and self._after.busy is not None:
            self._go_to(self._after.busy)
        self._draw()

    def offers_step(self, name: str) -> bool:
        return self._after.can(SessionTask(name))

    def offers_every(self) -> bool:
        return self._after.busy is None

    def offers_cancel(self) -> bool:
        return self._after.busy is not None

    def chosen_another(self) -> None:
        self._draw()

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        if STEPS[self.at] is SessionTask.ACCEPTANCE:
            self.action_acceptance()
        elif self._after.can(STEPS[self.at]):
            self._begin(STEPS[self.at])

    def action_step(self, name: str) -> None:
        self._begin(SessionTask(name))

    def action_every(self) -> None:
        self._begin(*USUAL)

    def action_acceptance(self) -> None:
        self._go_to(SessionTask.ACCEPTANCE)
        self.app.push_screen(AcceptanceScreen(self._after))

    def action_cancel(self) -> None:
        self._after.cancel()

    def action_back(self) -> None:
        if self._after.busy is None:
            self.dismiss()
            return

        def answered(sure: bool | None) -> None:  # noqa: FBT001 - answer of a question
            if sure:
                self._after.cancel()
                self.dismiss()

        self.app.push_screen(
            YesQuestion(
                "A step is being done. End it and go back?\n\nWhat is done already stays.\n\nY  end it      N or Esc  go on"
            ),
            answered,
        )

    def _begin(self, *steps: SessionTask) -> None:
        self._go_to(steps[0])
        self._after.do(*steps)
        self._draw()

    def _go_to(self, step: SessionTask) -> None:
        self.query_one("#rows", OptionList).highlighted = STEPS.index(step)

    def _draw(self) -> None:
        after = self._after
        if not self.stands:
            return
        self.put([_row(step, after.results[step]) for step in STEPS])
        self.about(self._found(STEPS[self.at]))
        if after.busy is not None:
            self.say("Working; K ends the step, Esc goes back.")
        else:
            self.say(f"Enter does the chosen step, 0 the first four; results go to {after.folder}.")
        self.keys_by((after.busy, after.model))

    def _found(self, step: SessionTask) -> Content:
        result = self._after.results[step]
        match result.progress:
            case WorkProgress.DONE:
                rows = [Content.styled(str(result.path), "bold")]
                return lines(*rows, *(Content(text) for text in result_lines(step, result.answer)))
            case WorkProgress.FAILED:
                return Content.styled(result.failure, "$text-error")
            case WorkProgress.CANCELLED:
                return Content("Ended before it was done; nothing of it was written.")
            case WorkProgress.RUNNING:
                return Content("")
        if step is SessionTask.PROGRAMS and self._after.model is None:
            return Content("Programs need a model: 1 calibrates, 2 diagnoses.")
        return Content.styled("Nothing yet.", "dim")


def _row(step: SessionTask, result: Result) -> Content:
    key, title = texts.STEPS[step]
    sign, words, style = texts.STEP_LOOKS[result.progress]
    words = words.format(stage=result.stage or texts.STEP_BEGINS, passed=duration(result.passed_s))
    return Content.assemble(f"{sign} ", (key, "bold"), f"  {title:48} ", (words, style))
