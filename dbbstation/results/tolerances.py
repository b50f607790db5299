"""Compare measured circles with the shop's tolerances, with uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.reporting.evaluation import stated
from dbbstation.circles.analysis import analyse_pair, refiltered
from dbbstation.circles.budget import budgets, pair_budgets
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.circles.extremes import without_noise
from dbbstation.circles.path import TOLERATED, Filter
from dbbstation.computing.arrays import hypot_of, norm_of
from dbbstation.facts import OfRunInSession, of_facts
from dbbstation.facts.digits import expanded_uncertainty
from dbbstation.facts.held import HeldTolerance, WorstCircle
from dbbstation.plan.tolerance import FILTERED, OF_A_MODEL, OF_BOTH_DIRECTIONS, CircleFigure
from dbbstation.quality.conformity import Conformity, Size, conformity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.circles.budget import Budget, SetUpKnowledge
    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.circles import MeasuredCircle, MeasuredPair


@dataclass(frozen=True)
class ToleratedCircle(OfRunInSession):
    """Figures of one circle that may have a tolerance.

    Attributes:
        direction: `ccw` or `cw`; `both` for both together.
        sizes: by figure; G about the least-squares circle, up to 30 undulations per revolution; empty for both directions.
    """

    sizes: Mapping[CircleFigure, Size]
    others: Mapping[tuple[CircleFigure, int], Size] = field(default_factory=dict)

    def size(self, tolerance: Tolerance) -> Size | None:
        """Return the figure that a tolerance limits, or None."""
        own = self.sizes.get(tolerance.figure)
        if own is not None and (tolerance.upr == TOLERATED or tolerance.figure not in FILTERED):
            return own
        return self.others.get((tolerance.figure, tolerance.upr))


def tolerated_circles(
    circles: Iterable[MeasuredCircle], tolerances: Sequence[Tolerance] = ()
) -> tuple[ToleratedCircle, ...]:
    """Return the figures of circles that may have a tolerance."""
    wanted = [
        (one.figure, one.upr)
        for one in tolerances
        if one.figure not in OF_BOTH_DIRECTIONS
        and (one.figure not in OF_A_MODEL or (one.figure in FILTERED and one.upr != TOLERATED))
    ]
    return tuple(
        of_facts(
            ToleratedCircle,
            one,
            one.entry,
            direction=str(one.entry.direction),
            sizes=sizes_of(refiltered(one.analysed, TOLERATED), one.known),
            others={key: _size_of(one.analysed, one.known, *key) for key in dict.fromkeys(wanted)},
        )
        for one in circles
    )


def tolerated_pairs(pairs: Iterable[MeasuredPair], tolerances: Sequence[Tolerance]) -> tuple[ToleratedCircle, ...]:
    """Return the figures with tolerances that combine both directions."""
    wanted = dict.fromkeys((one.figure, one.upr) for one in tolerances if one.figure in OF_BOTH_DIRECTIONS)
    return tuple(
        of_facts(
            ToleratedCircle,
            pair.one,
            pair.one.entry,
            direction="both",
            sizes={},
            others={key: _size_of_pair(pair, *key) for key in wanted},
        )
        for pair in (pairs if wanted else ())
    )


def _size_of(one: CircleAnalysis, known: SetUpKnowledge, figure: CircleFigure, upr: int) -> Size:
    filtered = refiltered(one, Filter(upr))
    quantities = (
        (BudgetQuantity.G_LS,)
        if figure is CircleFigure.CIRCULAR_DEVIATION
        else (BudgetQuantity.F_MAX, BudgetQuantity.F_MIN)
    )
    found = [budgets(filtered, known, quantities)[quantity] for quantity in quantities]
    return _sized(max(found, key=lambda budget: abs(budget.value_um)))


def _size_of_pair(pair: MeasuredPair, figure: CircleFigure, upr: int) -> Size:
    one, other = (refiltered(each, Filter(upr)) for each in (pair.analysis.one, pair.analysis.other))
    quantity = {
        CircleFigure.BIDIRECTIONAL_CIRCULAR_DEVIATION: BudgetQuantity.G_BOTH_LS,
        CircleFigure.MEAN_BIDIRECTIONAL_RADIAL_DEVIATION: BudgetQuantity.D,
        CircleFigure.CIRCULAR_HYSTERESIS: BudgetQuantity.H,
    }[figure]
    return _sized(pair_budgets(analyse_pair(one, other), pair.one.known)[quantity])


def _sized(budget: Budget) -> Size:
    return Size(abs(budget.value_um), budget.u_um, budget.why_not, budget.known_um)


def sizes_of(one: CircleAnalysis, known: SetUpKnowledge) -> dict[CircleFigure, Size]:
    """Return sizes with uncertainties."""
    found = budgets(one, known, (BudgetQuantity.G_LS, BudgetQuantity.MEAN_RADIAL, BudgetQuantity.X, BudgetQuantity.Y))
    return {
        CircleFigure.CIRCULAR_DEVIATION: _sized(found[BudgetQuantity.G_LS]),
        CircleFigure.CENTRE_DEVIATION: _off_centre(found[BudgetQuantity.X], found[BudgetQuantity.Y]),
        CircleFigure.MEAN_RADIAL_ERROR: _sized(found[BudgetQuantity.MEAN_RADIAL]),
    }


def _off_centre(x: Budget, y: Budget) -> Size:
    """Return the length of a centre offset without its bias by uncertainty, and its u from both axes."""
    off, u = np.array([x.value_um, y.value_um]), np.array([x.known_um, y.known_um])
    length = hypot_of(*off)
    # A centre that is not off has no direction: either axis may be the one that counts.
    along = np.abs(off) / length if length > 0.0 else np.sqrt([0.5, 0.5])
    value, u_value = without_noise(length, norm_of(along * u))
    why = x.why_not or y.why_not
    return Size(value, None if why else u_value, why, u_value)


def filter_words(tolerance: Tolerance) -> str | None:
    """Return the filter of a tolerance in words, or None."""
    return Filter(tolerance.upr).words if tolerance.figure in FILTERED else None


def held_tolerance(tolerance: Tolerance, circles: Iterable[ToleratedCircle], coverage_factor: float) -> HeldTolerance:
    """Compare a tolerance with its circles; arguments as in `conformity`."""
    sized = [
        (one, size)
        for one in circles
        if tolerance.holds_for(one.test, one.direction) and (size := one.size(tolerance)) is not None
    ]
    verdicts = [conformity(size, tolerance.largest_um, coverage_factor) for _, size in sized]
    order = (Conformity.EXCEEDED, Conformity.UNDECIDED, Conformity.WITHIN)
    found = next((each for each in order if each in verdicts), None)
    worst = None
    if sized:
        one, size = max(sized, key=lambda pair: pair[1].um)
        expanded_um = expanded_uncertainty(size.u_um, coverage_factor)
        worst = WorstCircle(*one.key, size.um, expanded_um, size.why_not or None)
    return HeldTolerance(
        **stated(tolerance),
        filter=filter_words(tolerance),
        conformity=None if found is None else str(found),
        within=found in {None, Conformity.WITHIN},
        exceeded=verdicts.count(Conformity.EXCEEDED),
        undecided=verdicts.count(Conformity.UNDECIDED),
        circles=len(sized),
        worst=worst,
    )
