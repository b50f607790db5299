"""Results of steps, line by line, with the numbers of their commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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
from dbbstation.service.job import SessionTask
from dbbstation.tui import texts
from dbbstation.tui.acceptance_lines import worst_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

_MOST = 6
"""Causes, and sentences of a kind, that are shown; the files have all."""


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
            yield texts.CAUSES.format(verdict=words, names=", ".join(names))
    yield answer.unexplained.text
    yield from ending_sentences(answer)


def _programmed(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield texts.PROGRAMMED.format(count=len(answer.programs), dialect=answer.dialect)
    greatest = [one.greatest_correction_um for one in answer.programs if one.greatest_correction_um is not None]
    if greatest:
        yield texts.CORRECTED.format(most=max(greatest))


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
    yield texts.DRAWN.format(count=len(answer.drawn))


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
