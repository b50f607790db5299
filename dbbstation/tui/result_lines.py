"""Results of steps, line by line, with the numbers of their commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.facts.serialise import read_plain
from dbbstation.service.answers import (
    AcceptanceAnswer,
    CalibrationAnswer,
    DiagnosisAnswer,
    ProgramsAnswer,
    ReportAnswer,
)
from dbbstation.service.job import SessionTask
from dbbstation.tui import texts
from dbbstation.tui.acceptance_lines import worst_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_MOST = 6
"""Causes, and sentences of a kind, that are shown; the files have all."""


def result_lines(step: SessionTask, answer: Mapping[str, object]) -> list[str]:
    """Return the main results of a step's JSON."""
    match step:
        case SessionTask.CALIBRATE:
            return list(_calibrated(read_plain(CalibrationAnswer, answer)))
        case SessionTask.DIAGNOSE:
            return list(_diagnosed(read_plain(DiagnosisAnswer, answer)))
        case SessionTask.PROGRAMS:
            return list(_programmed(read_plain(ProgramsAnswer, answer)))
        case SessionTask.REPORT:
            return list(_reported(read_plain(ReportAnswer, answer)))
        case SessionTask.ACCEPTANCE:
            return list(_accepted(read_plain(AcceptanceAnswer, answer)))


def _calibrated(answer: CalibrationAnswer) -> Iterator[str]:
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


def _diagnosed(answer: DiagnosisAnswer) -> Iterator[str]:
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


def _programmed(answer: ProgramsAnswer) -> Iterator[str]:
    yield texts.PROGRAMMED.format(count=len(answer.programs), dialect=answer.dialect)
    greatest = [one.greatest_correction_um for one in answer.programs if one.greatest_correction_um is not None]
    if greatest:
        yield texts.CORRECTED.format(most=max(greatest))


def _reported(answer: ReportAnswer) -> Iterator[str]:
    verdict = answer.verdict
    yield texts.REPORT_VERDICT[verdict.kind]
    yield verdict.headline
    yield from verdict.reasons[:_MOST]
    yield from verdict.to_do[:_MOST]


def _accepted(answer: AcceptanceAnswer) -> Iterator[str]:
    yield texts.ACCEPTANCE_VERDICT[answer.verdict.kind]
    yield from worst_lines(answer)
