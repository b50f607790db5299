"""From an evaluation to its result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.plan.tolerance import OF_A_MODEL, USUAL_UPR, CircleFigure, worst
from dbbstation.results.evaluation import CircleDeviations, EvaluatedRun, EvaluatedTolerance, WorstRun

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.calibration.reporting.evaluation import RunEvaluation
    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.trace.analysis import CircleFigures


def evaluated_runs(runs: Iterable[RunEvaluation]) -> tuple[EvaluatedRun, ...]:
    """Return figures of runs, before under the nominal machine and after under the model [CAL Table III]."""
    return tuple(
        EvaluatedRun(
            test=run.test,
            direction=run.direction,
            repeat=run.repeat,
            measured=_deviations(run.measured),
            before=_deviations(run.before, run.before_from_first_um),
            after=_deviations(run.after, run.after_from_first_um),
        )
        for run in runs
    )


def _deviations(figures: CircleFigures, from_first_um: float | None = None) -> CircleDeviations:
    return CircleDeviations(
        figures.centre_deviation_um, figures.mean_radial_error_um, figures.circularity_um, from_first_um
    )


def evaluated_tolerances(
    tolerances: Iterable[Tolerance], runs: Sequence[EvaluatedRun]
) -> tuple[EvaluatedTolerance, ...]:
    """Hold tolerances against runs, under the nominal machine and under the model.

    Args:
        tolerances: of the shop.
        runs: with the circular deviation of low-passed readings.
    """
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
        raise ValueError("tolerances are for the circular deviation of low-passed readings, which these runs lack")
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
