"""From a diagnosis to its result."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from dbbstation.calibration.outliers.outlier import SOURCE_OF, OutlierKind
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.facts.by_name import ByName
from dbbstation.facts.value import Value
from dbbstation.inference.verdict import Acts, Verdict
from dbbstation.results.diagnosis import (
    BeforeAfter,
    CauseResult,
    CircularityLeft,
    CurveFollows,
    DiagnosisFigures,
    DiagnosisResult,
    MisfitLocation,
    ParameterShift,
    ProposedTest,
    UnexplainedCurve,
    UnexplainedPoint,
    UnexplainedResult,
    WorkspaceGain,
)
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.findings import Curve, Diagnosis, Location, NextTest, SourceFinding
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.results.effects import CauseContribution


def diagnosis_figures(diagnosis: Diagnosis, lacking: Mapping[str, str]) -> DiagnosisFigures:
    """Return the figures of a diagnosis."""
    rest = diagnosis.unexplained
    before, after = diagnosis.held_out
    return DiagnosisFigures(
        mismatch=diagnosis.mismatch,
        probability=diagnosis.misfit.probability,
        noise_um=1e3 * diagnosis.left.noise,
        misfit_rms_um=1e3 * diagnosis.misfit.rms,
        residual_rms_um=BeforeAfter(rms_um(diagnosis.before.residual_mm), rms_um(diagnosis.after.residual_mm)),
        held_out_rms_um=BeforeAfter(1e3 * before.rms, 1e3 * after.rms),
        held_out_normalised=BeforeAfter(before.normalised, after.normalised),
        held_out="not-tested" if diagnosis.chosen_anew is None else "tested",
        held_out_worse=None if diagnosis.chosen_anew is None else diagnosis.chosen_anew.is_worse,
        circularity_um=_circularity(diagnosis),
        workspace=_workspace(diagnosis),
        outliers=tuple(outlier for outlier in diagnosis.outliers),
        locations=tuple(_location(location) for location in diagnosis.locations),
        sources=ByName(
            (
                *_mountings(diagnosis),
                *(_cause(source) for source in diagnosis.sources),
                *(CauseResult(name=name, verdict=str(Verdict.NOT_TESTABLE), text=why) for name, why in lacking.items()),
            )
        ),
        cancelling=diagnosis.cancelling,
        unexplained=UnexplainedResult(
            rms_um=rest.rms_um,
            strut=rest.strut,
            variable=rest.variable,
            text=rest.text,
            curve=None if rest.curve is None else _curve(rest.curve),
        ),
        parameter_shift=tuple(
            ParameterShift(
                parameter=shift.parameter,
                before_um=shift.before_um,
                after_um=shift.after_um,
                shift_um=shift.shift_um,
                uncertainty_um=shift.uncertainty_um,
            )
            for shift in diagnosis.shifts
        ),
        second_start_agrees=diagnosis.second_start_agrees,
        next_test=_proposed(diagnosis.next_tests[0]) if diagnosis.next_tests else None,
        further_tests=tuple(_proposed(test) for test in diagnosis.next_tests[1:]),
        levels=diagnosis.levels,
        limits=diagnosis.limits,
    )


def diagnosis_result(
    figures: DiagnosisFigures,
    *,
    effects: tuple[CauseContribution, ...],
    model: IdentifiedModel,
    drawing: Callable[[object], bytes],
    notes: tuple[str, ...],
) -> DiagnosisResult:
    """Return the whole result of a diagnosis."""
    own = {one.name: getattr(figures, one.name) for one in fields(DiagnosisFigures)}
    return DiagnosisResult(**{**own, "drawing": drawing, "notes": notes}, effects=effects, model=model)


def kept_of(figures: DiagnosisFigures) -> dict[str, object]:
    """Return the part of a diagnosis kept in a model file: doubts about causes, and limits reached."""
    open_ones = (one for one in figures.sources if one.verdict == Verdict.AMBIGUOUS)
    groups = {frozenset((one.name, *one.ambiguous_with)): [one.name, *one.ambiguous_with] for one in open_ones}
    return {
        "ambiguous": list(groups.values()),
        "held_out_worse": figures.held_out_worse,
        "said": list(figures.said),
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


def _workspace(diagnosis: Diagnosis) -> WorkspaceGain | None:
    found = diagnosis.workspace
    if found is None:
        return None
    return WorkspaceGain(
        error_rms_um=found.rms_um,
        error_greatest_um=found.greatest_um,
        at_pose=tuple(found.at_pose),
        uncertainty_rms_um=found.uncertainty_um,
        common_shift_um=tuple(found.shift_um),
        error_with_shift_rms_um=found.with_shift_rms_um,
        uncertainty_with_shift_rms_um=found.with_shift_uncertainty_um,
    )


def _mountings(diagnosis: Diagnosis) -> list[CauseResult]:
    causes = []
    for name in dict.fromkeys(SOURCE_OF.values()):
        of = [outlier for outlier in diagnosis.outliers if SOURCE_OF.get(outlier.kind) == name]
        if of:
            alike = sorted({other for outlier in of for other in outlier.alike})
            alike += [] if all(outlier.sure for outlier in of) else [other for other in BALLS if other != name]
            causes.append(
                CauseResult(
                    name=name,
                    verdict=str(Verdict.AMBIGUOUS if alike else Verdict.HAPPENED),
                    acts=Acts.ONCE.name.lower(),
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
"""What cannot be told apart where a ball was put up once only."""


def _location(location: Location) -> MisfitLocation:
    first, last = location.theta_deg
    by = f", by {location.variable}" if location.variable else ""
    strut = f", strut {location.strut} most" if location.strut else ""
    text = (
        f"test {location.test} {location.direction} from {first:.0f} to {last:.0f} degrees: up to "
        f"{location.peak_um:+.1f} µm{by}{strut}"
    )
    return MisfitLocation(
        test=location.test,
        direction=location.direction,
        theta_deg=(first, last),
        strut=location.strut,
        variable=location.variable or None,
        share=location.share,
        peak_um=location.peak_um,
        text=text,
    )


def _cause(source: SourceFinding) -> CauseResult:
    return CauseResult(
        name=source.name,
        verdict=str(source.verdict),
        ambiguous_with=tuple(source.ambiguous_with),
        concealed=source.concealed,
        signature_rms_um=source.whole_um,
        unconcealed_rms_um=source.rest_um,
        gain=source.gain,
        stability=source.stability,
        probability=source.probability,
        equivalent=tuple(source.equivalent),
        log_evidence=source.gain,
        acts=source.acts.name.lower(),
        persists=source.persists,
        sigmas=source.sigmas,
        gains=source.gains,
        parameters={name: Value(v.value, v.uncertainty, v.unit) for name, v in source.parameters.items()},
        text=source.text,
    )


def _curve(curve: Curve) -> UnexplainedCurve:
    own = {one.name: getattr(curve, one.name) for one in fields(curve)}
    follows = CurveFollows(curve.follows.variable, curve.follows.kind, curve.follows.moves)
    points = tuple(UnexplainedPoint(point.at, point.value_um, point.uncertainty_um) for point in curve.points)
    return UnexplainedCurve(
        **{**own, "follows": follows, "points": points}, variable=curve.variable, period_mm=curve.period_mm
    )


def _proposed(test: NextTest) -> ProposedTest:
    return ProposedTest(
        text=test.text,
        **test.circle,
        source=test.source,
        sigma_before=test.sigma_before,
        sigma_after=test.sigma_after,
        unit=test.unit,
    )
