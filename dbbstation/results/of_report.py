"""Make a report's figures, now and before, from circles and tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.facts.held import ComparedTolerance, ToleranceOfTest
from dbbstation.plan.tolerance import OF_A_MODEL
from dbbstation.results.report import MeanAndLargest, MeasuredFigures, MeasuredMean, MeasuredSize
from dbbstation.results.tolerances import held_tolerance

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.tolerances import ToleratedCircle


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
        yield MeasuredFigures(
            one.session, one.test, one.direction, one.repeat, now=_sizes(one), before=former.get(one.key)
        )


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
