"""What a report shows: the result of `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from dbbstation.facts.serialise import Kept
from dbbstation.results.circles import CirclesResult
from dbbstation.results.effects import CauseContribution
from dbbstation.results.evaluation import EvaluationResult
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class ReportVerdict:
    """What a foreman reads first.

    Attributes:
        kind: `within`, `exceeded`, `cannot tell` or `none`, where nothing was held against anything.
        reasons: one sentence for each tolerance that is not kept.
        to_do: what to do, in order.
    """

    kind: str
    headline: str
    reasons: tuple[str, ...]
    to_do: tuple[str, ...]


@dataclass(frozen=True)
class CertificateState:
    """Whether a report is a certificate.

    Attributes:
        title: what stands at its top.
        lacking: what a certificate needs and this report has not; empty where it is one.
        place: where it was measured; None where nobody says.
    """

    title: str
    lacking: tuple[str, ...]
    place: str | None


@dataclass(frozen=True)
class WorstCircle:
    """The circle with the largest figure that a tolerance is for.

    Attributes:
        direction: `ccw` or `cw`; `both` of both directions together.
        repeat: counts runs of this test and direction.
        expanded_um: U = k u of it [µm]; None where not known.
        why_not: why it is not known; None where it is.
    """

    test: str
    direction: str
    repeat: int
    um: float
    expanded_um: float | None
    why_not: str | None


@dataclass(frozen=True, kw_only=True)
class HeldTolerance:
    """A tolerance held against circles [ISO 14253-1].

    Attributes:
        filter: of that figure in words; None where none acts on it.
        tests: that it holds for; empty for all.
        directions: that it holds for; empty for both.
        conformity: `exceeded` where one circle exceeds it, else `cannot tell` where one is within U of it; None where it holds
            for none.
        within: whether no circle exceeds it or is undecided.
        exceeded: how many circles exceed it.
        undecided: how many lie within U of it.
        circles: how many it holds for.
        worst: the one with the largest figure; None where it holds for none.
    """

    quantity: str
    filter: str | None
    largest_um: float
    tests: tuple[str, ...]
    directions: tuple[str, ...]
    conformity: str | None
    within: bool
    exceeded: int
    undecided: int
    circles: int
    worst: WorstCircle | None


@dataclass(frozen=True, kw_only=True)
class ComparedTolerance(HeldTolerance):
    """A tolerance held against circles now, and against those before.

    Attributes:
        before: the same tolerance and the circles before; None where it holds for none of them.
    """

    before: HeldTolerance | None


@dataclass(frozen=True, kw_only=True)
class ToleranceOfTest(ComparedTolerance):
    """A tolerance held against the circles of one test."""

    test: str


@dataclass(frozen=True)
class MeasuredSize:
    """A figure of one circle as measured.

    Attributes:
        u_um: its standard uncertainty [µm]; None where a cause of unknown size counts.
    """

    um: float
    u_um: float | None


@dataclass(frozen=True)
class MeasuredFigures:
    """Figures of one circle as measured, by what they are, beside those of the same test, direction and repeat before.

    Attributes:
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
    """

    session: str
    test: str
    direction: str
    repeat: int
    now: Mapping[str, MeasuredSize]
    before: Mapping[str, MeasuredSize] | None


@dataclass(frozen=True)
class MeanAndLargest:
    """Mean and largest of a figure over circles."""

    mean_um: float
    largest_um: float


@dataclass(frozen=True)
class MeasuredMean:
    """Mean and largest of a figure over the circles; where there are circles before, over those that were measured both times.

    Attributes:
        now: over the circles; None without circles.
        before: over the same circles before; None without those.
    """

    quantity: str
    circles: int
    now: MeanAndLargest | None
    before: MeanAndLargest | None


@dataclass(frozen=True)
class NotEvaluated:
    """In place of what a model leaves, where that could not be worked out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportResult(Framed):
    """The numbers of a report, and where it was written.

    Attributes:
        pdf: the same on paper; None where it was not printed.
        verdict: what the shop's tolerances say.
        tolerances: of the shop, held against the circles.
        circles: figures after ISO 230-4.
        causes: what each cause of the model contributes, the greatest first.
        causes_of: session whose circles they act on; None where there are none.
        model: what the model leaves; None without a model.
    """

    report: str
    pdf: Annotated[Path | None, Kept] = None
    verdict: ReportVerdict
    certificate: CertificateState
    model_warnings: tuple[str, ...]
    coverage_factor: float
    tolerances: tuple[ComparedTolerance, ...]
    tolerances_by_test: tuple[ToleranceOfTest, ...]
    measured: tuple[MeasuredFigures, ...]
    measured_means: tuple[MeasuredMean, ...]
    circles: CirclesResult
    causes: tuple[CauseContribution, ...]
    causes_of: str | None
    model: EvaluationResult | NotEvaluated | None

    def rows(self) -> list[dict[str, object]]:
        """Figures of the circles as measured, one row for each; lengths in µm."""
        return [
            {
                "session": one.session,
                "test": one.test,
                "direction": one.direction,
                "repeat": one.repeat,
                **{
                    f"{name.replace('-', '_')}_{unit}": value
                    for name, size in one.now.items()
                    for unit, value in (("um", size.um), ("u_um", size.u_um))
                },
            }
            for one in self.measured
        ]
