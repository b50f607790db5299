"""The result of `report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.diagnosis.effects import CauseEffect
from dbbstation.facts import OfRunInSession, of_facts, picked
from dbbstation.facts.held import ComparedTolerance, ReportVerdict, ToleranceOfTest
from dbbstation.facts.serialise import Kept
from dbbstation.plan.tolerance import OF_A_MODEL
from dbbstation.results.calibration import EvaluationResult
from dbbstation.results.circles import CirclesResult
from dbbstation.results.frame import Framed
from dbbstation.results.tolerances import held_tolerance

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.tolerances import ToleratedCircle


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


def tolerances_by_test(
    tests: Iterable[str],
    tolerances: Sequence[Tolerance],
    both: tuple[Sequence[ToleratedCircle], Sequence[ToleratedCircle]],
    coverage_factor: float,
) -> Iterable[ToleranceOfTest]:
    """Compare every tolerance with the circles of each of its tests."""
    for test in tests:
        now, before = ([one for one in circles if one.test == test] for circles in both)
        for one in tolerances:
            if any(one.holds_for(circle.test, circle.direction) and circle.size(one) is not None for circle in now):
                yield ToleranceOfTest(test=test, **vars(compared(one, now, before, coverage_factor)))


def compared(
    tolerance: Tolerance, now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle], coverage_factor: float
) -> ComparedTolerance:
    """Compare one tolerance with circles now and before, if it applies."""
    former = held_tolerance(tolerance, before, coverage_factor)
    told = None if former.worst is None else former
    return ComparedTolerance(**vars(held_tolerance(tolerance, now, coverage_factor)), before=told)


def side_by_side(now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle]) -> Iterable[MeasuredFigures]:
    """Yield measured figures, each with the former figures of the same test, direction and repeat."""
    former = {one.key: _sizes(one) for one in before}
    for one in now:
        yield of_facts(MeasuredFigures, one, now=_sizes(one), before=former.get(one.key))


def _sizes(one: ToleratedCircle) -> dict[str, MeasuredSize]:
    return {str(figure): MeasuredSize(size.um, size.u_um) for figure, size in one.sizes.items()}


def means_of(measured: Sequence[MeasuredFigures]) -> Iterable[MeasuredMean]:
    """Yield mean and largest of each figure, over circles measured both times, if any, else over all."""
    both = [one for one in measured if one.before is not None]
    taken = both or measured
    for figure in OF_A_MODEL:
        yield MeasuredMean(
            quantity=figure.value,
            circles=len(taken),
            now=_mean_and_largest([one.now[figure.value].um for one in taken]),
            before=_mean_and_largest([one.before[figure.value].um for one in both if one.before is not None]),
        )


def _mean_and_largest(sizes: Sequence[float]) -> MeanAndLargest | None:
    return MeanAndLargest(sum(sizes) / len(sizes), max(sizes)) if sizes else None
