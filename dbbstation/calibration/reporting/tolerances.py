"""Compare the shop's tolerances with a model's figures of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.plan.tolerance import OF_A_MODEL, USUAL_UPR, CircleFigure, worst

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.calibration.reporting.evaluation import CircleDeviations, EvaluatedRun
    from dbbstation.plan.tolerance import Tolerance


@dataclass(frozen=True)
class WorstRun:
    """The run with the largest toleranced figure."""

    run: str
    worst_um: float
    within: bool


@dataclass(frozen=True)
class EvaluatedTolerance:
    """A tolerance and its worst runs.

    Attributes:
        before: worst run under the nominal machine; None without applicable run.
        after: the same under the model.
    """

    quantity: str
    largest_um: float
    tests: tuple[str, ...]
    directions: tuple[str, ...]
    before: WorstRun | None
    after: WorstRun | None


def evaluated_tolerances(
    tolerances: Iterable[Tolerance], runs: Sequence[EvaluatedRun]
) -> tuple[EvaluatedTolerance, ...]:
    """Compare tolerances with runs under the nominal machine and under the model."""
    return tuple(
        EvaluatedTolerance(
            quantity=tolerance.figure.value,
            largest_um=tolerance.largest_um,
            tests=tuple(tolerance.tests),
            directions=tuple(direction.value for direction in tolerance.directions),
            before=_worst(tolerance, [(run, run.before, _low_passed(run)[0]) for run in runs]),
            after=_worst(tolerance, [(run, run.after, _low_passed(run)[1]) for run in runs]),
        )
        for tolerance in tolerances
        if tolerance.figure in OF_A_MODEL and tolerance.upr == USUAL_UPR
    )


def _low_passed(run: EvaluatedRun) -> tuple[float, float]:
    if run.circularity_30_upr_um is None:
        raise ValueError("these runs have no low-passed readings, which the tolerances need")
    return run.circularity_30_upr_um.before, run.circularity_30_upr_um.after


def _worst(tolerance: Tolerance, runs: Sequence[tuple[EvaluatedRun, CircleDeviations, float]]) -> WorstRun | None:
    named = [
        (
            run.test,
            run.direction,
            run.repeat,
            {
                CircleFigure.CIRCULAR_DEVIATION: circular_um,
                CircleFigure.CENTRE_DEVIATION: of.centre_deviation_um,
                CircleFigure.MEAN_RADIAL_ERROR: of.mean_radial_error_um,
            },
        )
        for run, of, circular_um in runs
    ]
    one = worst(tolerance, named)
    return None if one is None else WorstRun(one.run, one.size_um, one.within)
