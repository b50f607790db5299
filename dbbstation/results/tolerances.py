"""From measured circles to what the shop's tolerances say of them, uncertainty included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.analysis import refiltered
from dbbstation.circles.budget import budgets
from dbbstation.circles.path import Filter
from dbbstation.circles.quantity import BudgetQuantity
from dbbstation.circles.rice import without_noise
from dbbstation.plan.tolerance import CircleFigure
from dbbstation.quality.conformity import Conformity, Size, conformity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.circles.budget import Budget, SetUpKnowledge
    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.circles import MeasuredCircle


@dataclass(frozen=True)
class ToleratedCircle:
    """Figures of one circle that may have a tolerance.

    Attributes:
        session: name of its session.
        test: name of its test.
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        sizes: by figure; G is about the least-squares circle, up to 30 undulations per revolution.
    """

    session: str
    test: str
    direction: str
    repeat: int
    sizes: Mapping[CircleFigure, Size]

    @property
    def key(self) -> tuple[str, str, int]:
        """Test, direction and repeat."""
        return self.test, self.direction, self.repeat


@dataclass(frozen=True)
class Held:
    """A tolerance held against circles.

    Attributes:
        tolerance: the limit.
        conformity: exceeded where one circle exceeds it, else undecided where one is; None where it holds for none.
        worst: the circle with the largest figure; None where it holds for none.
        exceeded: how many circles exceed it.
        undecided: how many lie within U of the limit.
        circles: how many it holds for.
    """

    tolerance: Tolerance
    conformity: Conformity | None
    worst: ToleratedCircle | None
    exceeded: int
    undecided: int
    circles: int


def tolerated_circles(circles: Iterable[MeasuredCircle]) -> tuple[ToleratedCircle, ...]:
    """Return the figures of measured circles that may have a tolerance; without runs that show no circle."""
    return tuple(
        ToleratedCircle(
            one.session,
            one.entry.test,
            str(one.entry.direction),
            one.entry.repeat,
            sizes_of(refiltered(one.analysis, TOLERATED), one.known),
        )
        for one in circles
        if one.analysis is not None
    )


TOLERATED = Filter.UPR_30
"""Filter of the circular deviation that a tolerance is for: the one that `evaluate` compares with predictions."""


def sizes_of(one: CircleAnalysis, known: SetUpKnowledge) -> dict[CircleFigure, Size]:
    """Sizes with their uncertainties."""
    found = budgets(one, known, (BudgetQuantity.G_LS, BudgetQuantity.MEAN_RADIAL, BudgetQuantity.X, BudgetQuantity.Y))
    g, radial = found[BudgetQuantity.G_LS], found[BudgetQuantity.MEAN_RADIAL]
    return {
        CircleFigure.CIRCULAR_DEVIATION: Size(g.value_um, g.u_um, g.why_not, g.known_um),
        CircleFigure.CENTRE_DEVIATION: _off_centre(found[BudgetQuantity.X], found[BudgetQuantity.Y]),
        CircleFigure.MEAN_RADIAL_ERROR: Size(abs(radial.value_um), radial.u_um, radial.why_not, radial.known_um),
    }


def _off_centre(x: Budget, y: Budget) -> Size:
    """Length of a centre offset, less what its uncertainty adds to it; u of both axes along it counts."""
    off, u = np.array([x.value_um, y.value_um]), np.array([x.known_um, y.known_um])
    length = float(np.hypot(*off))
    # A centre that is not off has no direction: either axis may be the one that counts.
    along = np.abs(off) / length if length > 0.0 else np.sqrt([0.5, 0.5])
    value, u_value = without_noise(length, float(np.linalg.norm(along * u)))
    return Size(value, u_value, "", u_value)


def held_against(
    tolerances: Sequence[Tolerance], circles: Sequence[ToleratedCircle], coverage_factor: float
) -> tuple[Held, ...]:
    """Hold every tolerance against the circles that it is for; arguments as of `conformity`."""
    return tuple(_held(tolerance, circles, coverage_factor) for tolerance in tolerances)


def _held(tolerance: Tolerance, circles: Sequence[ToleratedCircle], coverage_factor: float) -> Held:
    of = [one for one in circles if tolerance.holds_for(one.test, one.direction)]
    verdicts = [conformity(one.sizes[tolerance.figure], tolerance.largest_um, coverage_factor) for one in of]
    worst = max(of, key=lambda one: one.sizes[tolerance.figure].um, default=None)
    order = (Conformity.EXCEEDED, Conformity.UNDECIDED, Conformity.WITHIN)
    return Held(
        tolerance=tolerance,
        conformity=next((each for each in order if each in verdicts), None),
        worst=worst,
        exceeded=verdicts.count(Conformity.EXCEEDED),
        undecided=verdicts.count(Conformity.UNDECIDED),
        circles=len(of),
    )
