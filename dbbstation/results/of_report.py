"""From circles and tolerances to a report's figures, now and before."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.facts.held import ComparedTolerance, HeldTolerance, ToleranceOfTest, WorstCircle
from dbbstation.plan.tolerance import OF_A_MODEL
from dbbstation.quality.conformity import Conformity
from dbbstation.results.report import MeanAndLargest, MeasuredFigures, MeasuredMean, MeasuredSize
from dbbstation.results.tolerances import filter_words, held_against
from dbbstation.text.digits import expanded_uncertainty

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.tolerances import Held, ToleratedCircle


def tolerances_by_test(
    tests: Iterable[str],
    tolerances: Sequence[Tolerance],
    both: tuple[Sequence[ToleratedCircle], Sequence[ToleratedCircle]],
    coverage_factor: float,
) -> Iterable[ToleranceOfTest]:
    """Yield every tolerance against the circles of each of its tests."""
    for test in tests:
        now, before = ([one for one in circles if one.test == test] for circles in both)
        for one in tolerances:
            if any(one.holds_for(circle.test, circle.direction) and circle.size(one) is not None for circle in now):
                yield ToleranceOfTest(test=test, **vars(compared(one, now, before, coverage_factor)))


def compared(
    tolerance: Tolerance, now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle], coverage_factor: float
) -> ComparedTolerance:
    """Return one tolerance against circles now and before, if it applies."""
    (held,) = held_against((tolerance,), now, coverage_factor)
    (former,) = held_against((tolerance,), before, coverage_factor)
    told = None if former.worst is None else _held(former, coverage_factor)
    return ComparedTolerance(**vars(_held(held, coverage_factor)), before=told)


def _held(held: Held, coverage_factor: float) -> HeldTolerance:
    tolerance = held.tolerance
    return HeldTolerance(
        quantity=tolerance.figure.value,
        filter=filter_words(tolerance),
        largest_um=tolerance.largest_um,
        tests=tuple(tolerance.tests),
        directions=tuple(direction.value for direction in tolerance.directions),
        conformity=None if held.conformity is None else str(held.conformity),
        within=held.conformity in {None, Conformity.WITHIN},
        exceeded=held.exceeded,
        undecided=held.undecided,
        circles=held.circles,
        worst=_worst(held, coverage_factor),
    )


def _worst(held: Held, coverage_factor: float) -> WorstCircle | None:
    worst, size = held.worst, held.size
    if worst is None or size is None:
        return None
    expanded_um = expanded_uncertainty(size.u_um, coverage_factor)
    return WorstCircle(worst.test, worst.direction, worst.repeat, size.um, expanded_um, size.why_not or None)


def side_by_side(now: Sequence[ToleratedCircle], before: Sequence[ToleratedCircle]) -> Iterable[MeasuredFigures]:
    """Yield measured figures, with those of the same test, direction and repeat before."""
    former = {one.key: _sizes(one) for one in before}
    for one in now:
        yield MeasuredFigures(
            one.session, one.test, one.direction, one.repeat, now=_sizes(one), before=former.get(one.key)
        )


def _sizes(one: ToleratedCircle) -> dict[str, MeasuredSize]:
    return {str(figure): MeasuredSize(size.um, size.u_um) for figure, size in one.sizes.items()}


def means_of(measured: Sequence[MeasuredFigures]) -> Iterable[MeasuredMean]:
    """Yield mean and largest of each figure, also of circles measured both times."""
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
