"""The result of `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from dbbstation.facts.held import ComparedTolerance, ReportVerdict, ToleranceOfTest
from dbbstation.facts.run import OfRunInSession
from dbbstation.facts.serialise import Kept
from dbbstation.results.circles import CirclesResult
from dbbstation.results.effects import CauseContribution
from dbbstation.results.evaluation import EvaluationResult
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class CertificateState:
    """Whether a report is a certificate.

    Attributes:
        lacking: missing parts; empty for a certificate.
        place: None if not stated.
    """

    title: str
    lacking: tuple[str, ...]
    place: str | None


@dataclass(frozen=True)
class MeasuredSize:
    """A figure of one circle as measured.

    Attributes:
        u_um: standard uncertainty; None if a cause of unknown size counts.
    """

    um: float
    u_um: float | None


@dataclass(frozen=True)
class MeasuredFigures(OfRunInSession):
    """Measured figures of one circle, with those of the same run before."""

    now: Mapping[str, MeasuredSize]
    before: Mapping[str, MeasuredSize] | None


@dataclass(frozen=True)
class MeanAndLargest:
    """Mean and largest of a figure over circles."""

    mean_um: float
    largest_um: float


@dataclass(frozen=True)
class MeasuredMean:
    """Mean and largest of a figure, over circles measured both times if there are earlier ones.

    Attributes:
        now: None without circles.
        before: None without earlier circles.
    """

    quantity: str
    circles: int
    now: MeanAndLargest | None
    before: MeanAndLargest | None


@dataclass(frozen=True)
class NotEvaluated:
    """Why a model's residual could not be computed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportResult(Framed):
    """The numbers of a report, and where it was written.

    Attributes:
        pdf: None if not printed.
        verdict: by the shop's tolerances.
        circles: figures after ISO 230-4.
        causes: contributions, the greatest first.
        causes_of: session of these circles, or None.
        model: what it leaves; None without a model.
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
        """Return one row per circle; lengths in µm."""
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
