"""Make the result of a diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.calibration.outliers.outlier import SOURCE_OF, OutlierKind
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.diagnosis.findings import SourceFinding
from dbbstation.facts.by_name import ByName
from dbbstation.facts.value import Value
from dbbstation.inference.verdict import Acts, Verdict
from dbbstation.results.diagnosis import BeforeAfter, CircularityLeft, DiagnosisFigures, DiagnosisResult
from dbbstation.results.frame import of_facts
from dbbstation.results.levels_text import bars
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.effects import CauseEffect
    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.model.identified import IdentifiedModel


def diagnosis_figures(diagnosis: Diagnosis, lacking: Mapping[str, str]) -> DiagnosisFigures:
    """Return the figures of a diagnosis."""
    before, after = diagnosis.held_out
    return of_facts(
        DiagnosisFigures,
        diagnosis,
        probability=diagnosis.misfit.probability,
        noise_um=1e3 * diagnosis.left.noise,
        misfit_rms_um=1e3 * diagnosis.misfit.rms,
        residual_rms_um=BeforeAfter(rms_um(diagnosis.before.residual_mm), rms_um(diagnosis.after.residual_mm)),
        held_out_rms_um=BeforeAfter(1e3 * before.rms, 1e3 * after.rms),
        held_out_normalised=BeforeAfter(before.normalised, after.normalised),
        held_out="not-tested" if diagnosis.chosen_anew is None else "tested",
        held_out_worse=None if diagnosis.chosen_anew is None else diagnosis.chosen_anew.is_worse,
        circularity_um=_circularity(diagnosis),
        sources=ByName(
            (
                *_mountings(diagnosis),
                *diagnosis.sources,
                *(
                    SourceFinding(name=name, verdict=Verdict.NOT_TESTABLE, ambiguous_with=(), text=why)
                    for name, why in lacking.items()
                ),
            )
        ),
        parameter_shift=diagnosis.shifts,
        next_test=diagnosis.next_tests[0] if diagnosis.next_tests else None,
        further_tests=diagnosis.next_tests[1:],
    )


def diagnosis_result(
    figures: DiagnosisFigures,
    *,
    effects: tuple[CauseEffect, ...],
    model: IdentifiedModel,
    drawing: Callable[[object], bytes],
    notes: tuple[str, ...],
) -> DiagnosisResult:
    """Return the whole result of a diagnosis."""
    return of_facts(DiagnosisResult, figures, drawing=drawing, notes=notes, effects=effects, model=model)


def kept_of(figures: DiagnosisFigures) -> dict[str, object]:
    """Return the part of a diagnosis for the model file: doubts about causes, and limits reached."""
    open_ones = (one for one in figures.sources if one.verdict == Verdict.AMBIGUOUS)
    groups = {frozenset((one.name, *one.ambiguous_with)): [one.name, *one.ambiguous_with] for one in open_ones}
    return {
        "ambiguous": list(groups.values()),
        "held_out_worse": figures.held_out_worse,
        "said": list(figures.said),
        "picture": bars(figures.levels, "µm"),
        "verdicts": {one.name: one.verdict for one in figures.sources},
        "limits": [limit.text for limit in figures.limits],
    }


def _circularity(diagnosis: Diagnosis) -> tuple[CircularityLeft, ...]:
    return tuple(
        CircularityLeft(
            run.test,
            str(run.raw.circle.direction),
            run.repeat,
            *(figures(run.raw, run.raw.circle.bar_mm + left).circularity_um for left in both),
        )
        for run, *both in zip(
            diagnosis.before.observations, diagnosis.before.residual_mm, diagnosis.after.residual_mm, strict=True
        )
    )


def _mountings(diagnosis: Diagnosis) -> list[SourceFinding]:
    causes = []
    for name in dict.fromkeys(SOURCE_OF.values()):
        of = [outlier for outlier in diagnosis.outliers if SOURCE_OF.get(outlier.kind) == name]
        if of:
            alike = sorted({other for outlier in of for other in outlier.alike})
            alike += [] if all(outlier.sure for outlier in of) else [other for other in BALLS if other != name]
            causes.append(
                SourceFinding(
                    name=name,
                    verdict=Verdict.AMBIGUOUS if alike else Verdict.HAPPENED,
                    acts=Acts.ONCE,
                    ambiguous_with=tuple(alike),
                    parameters={
                        _of(outlier): Value(outlier.size_um, outlier.uncertainty_um, "µm")
                        for outlier in of
                        if outlier.uncertainty_um is not None
                    },
                    text="; ".join(outlier.text for outlier in of),
                )
            )
    return causes


def _of(outlier: Outlier) -> str:
    return f"offset ({outlier.test})" if outlier.kind is OutlierKind.BAR else f"distance ({outlier.runs})"


BALLS = ("mounting", "ball-coordinate")
"""Effects that cannot be separated if each ball was put up only once."""
