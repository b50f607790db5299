"""The result of `diagnose`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import computed_field

from dbbstation.calibration.outliers.outlier import SOURCE_OF, Outlier, OutlierKind
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.diagnosis.effects import CauseEffect, WorkspaceError
from dbbstation.diagnosis.findings import Location, NextTest, Shift, SourceFinding, Unexplained
from dbbstation.facts import BeforeAfter, OfRun, of_facts
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import Cancelling
from dbbstation.inference.levels import Acts, Levels, LimitReached, Verdict
from dbbstation.results.calibration import WithModel
from dbbstation.results.frame import ByName, Framed
from dbbstation.results.levels_text import bars, level_sentences, short_sentences
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.diagnosis.findings import Diagnosis


@dataclass(frozen=True)
class CircularityLeft(BeforeAfter, OfRun):
    """Residual circularity of one run [µm]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisFigures(Framed):
    """Results of a diagnosis: kinematic calibration `before`, joint model `after`.

    Attributes:
        mismatch: whether recordings contradict the kinematic model.
        probability: of that misfit by chance.
        held_out: `tested`, or `not-tested` for too few tests.
        held_out_worse: whether predictions get worse; None if not tested.
        second_start_agrees: whether a second search agrees; None without one.
        limits: search, parameters and joint fit that ended at a limit.
        levels: existence, variables and cause of a difference.
    """

    mismatch: bool
    probability: float
    noise_um: float
    misfit_rms_um: float
    residual_rms_um: BeforeAfter
    held_out_rms_um: BeforeAfter
    held_out_normalised: BeforeAfter
    held_out: str
    held_out_worse: bool | None
    circularity_um: tuple[CircularityLeft, ...]
    workspace: WorkspaceError | None
    outliers: tuple[Outlier, ...]
    locations: tuple[Location, ...]
    sources: ByName[SourceFinding]
    cancelling: Cancelling | None
    unexplained: Unexplained
    parameter_shift: tuple[Shift, ...]
    second_start_agrees: bool | None
    next_test: NextTest | None
    further_tests: tuple[NextTest, ...]
    levels: Levels
    limits: tuple[LimitReached, ...] = ()

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        values = {one.name: one.parameters for one in self.sources}
        what = "Measured circles and the kinematic model"
        return level_sentences(self.levels, "µm", values, rows="tests", what=what)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def said(self) -> tuple[str, ...]:
        """Return two sentences for a report or a screen: whether a difference exists, and its main variable."""
        return short_sentences(self.levels, "µm", "Measured circles and the kinematic model")

    @property
    def identified(self) -> tuple[SourceFinding, ...]:
        """Return causes with the verdict `identified`."""
        return tuple(one for one in self.sources if one.verdict == "identified")

    def headline(self) -> str:
        """Return the misfit and the identified causes."""
        named = ", ".join(one.name for one in self.identified) or "nothing"
        if not self.mismatch:
            return f"the recordings agree with the kinematic model, {self.noise_um:.2f} µm noise"
        return f"misfit {self.misfit_rms_um:.2f} µm rms beyond noise; identified: {named}"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per cause."""
        return [
            {
                "cause": one.name,
                "verdict": one.verdict,
                "probability": one.probability,
                "log_bayes_factor": one.gain,
                "concealed": one.concealed,
            }
            for one in self.sources
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisResult(DiagnosisFigures, WithModel):
    """The result of a diagnosis."""

    effects: tuple[CauseEffect, ...]


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
        held_out="not-tested" if diagnosis.held_out_worse is None else "tested",
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
