"""The result of `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from dbbstation.diagnosis.effects import CauseEffect
from dbbstation.facts.held import ComparedTolerance, ReportVerdict, ToleranceOfTest
from dbbstation.facts.run import OfRunInSession
from dbbstation.facts.serialise import Kept
from dbbstation.results.circles import CirclesResult
from dbbstation.results.evaluation import EvaluationResult
from dbbstation.results.frame import Framed, picked


@dataclass(frozen=True)
class CertificateState:
    """Whether a report is a certificate."""

    title: str
    lacking: tuple[str, ...]
    place: str | None


@dataclass(frozen=True)
class MeasuredSize:
    """A figure of one circle as measured."""

    um: float
    u_um: float | None


@dataclass(frozen=True)
class MeasuredFigures(OfRunInSession):
    """Measured figures of one circle, with the former figures of the same run."""

    now: Mapping[str, MeasuredSize]
    before: Mapping[str, MeasuredSize] | None


@dataclass(frozen=True)
class MeanAndLargest:
    """Mean and largest of a figure over circles."""

    mean_um: float
    largest_um: float


@dataclass(frozen=True)
class MeasuredMean:
    """Mean and largest of a figure. If there is an earlier session, they are over circles that were measured both times."""

    quantity: str
    circles: int
    now: MeanAndLargest | None
    before: MeanAndLargest | None


@dataclass(frozen=True)
class NotEvaluated:
    """Why a model's residual could not be computed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportResult(Framed):
    """The numbers of a report, and the file's path.

    Attributes:
        circles: figures after ISO 230-4.
        causes_of: session whose circles the causes affect, or None.
        model: residual of the model; None without a model.
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
    causes: tuple[CauseEffect, ...]
    causes_of: str | None
    model: EvaluationResult | NotEvaluated | None

    def rows(self) -> list[dict[str, object]]:
        """Return one row per circle; lengths in µm."""
        return [
            {
                **picked(one, "session", "test", "direction", "repeat"),
                **{
                    f"{name.replace('-', '_')}_{unit}": value
                    for name, size in one.now.items()
                    for unit, value in (("um", size.um), ("u_um", size.u_um))
                },
            }
            for one in self.measured
        ]
