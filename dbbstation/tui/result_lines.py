"""Results of steps, line by line, with the numbers of their commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.facts.serialise import as_objects
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
    yield texts.FITTED.format(
        count=answer.parameters_identified,
        nominal=answer.nominal_rms_um,
        left=answer.residual_rms_um,
        within=answer.residual_within_mounting_rms_um,
        noise=answer.noise_um,
    )
    if answer.misfit.missing_physics:
        yield texts.PHYSICS_MISSING.format(rms=answer.misfit.rms_um)
    for outlier in answer.outliers[:_MOST]:
        yield texts.OUTLIER.format(text=outlier.text)
    for text in answer.directions_lost[:_MOST]:
        yield texts.UNSEEN.format(text=text)
    for text in answer.gaps[:_MOST]:
        yield texts.GAP.format(text=text)
    if not answer.directions_lost:
        yield texts.ALL_SEEN
    if not answer.plan_check.enough:
        yield texts.TOO_FEW.format(tests=answer.plan_check.tests, left=answer.plan_check.left)


def _diagnosed(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    yield from answer.said
    form = texts.MISMATCH if answer.mismatch else texts.NO_MISMATCH
    yield form.format(rms=answer.misfit_rms_um, noise=answer.noise_um)
    for verdict, words in texts.VERDICT_WORDS.items():
        names = [cause.name for cause in answer.sources if cause.verdict == verdict]
        if names:
            yield texts.CAUSES.format(verdict=words, names=", ".join(names))
    yield answer.unexplained.text
    yield from (limit.text for limit in answer.limits)
    if answer.next_test is not None:
        yield texts.MEASURE_NEXT.format(text=answer.next_test.text)


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


_LINES: dict[SessionTask, Callable[[Any], Iterator[str]]] = {
    SessionTask.CALIBRATE: _calibrated,
    SessionTask.DIAGNOSE: _diagnosed,
    SessionTask.PROGRAMS: _programmed,
    SessionTask.REPORT: _reported,
    SessionTask.ACCEPTANCE: _accepted,
}
