"""From measured circles to what the shop's tolerances say of them, uncertainty included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.reporting.prediction import smooth_circularity_um
from dbbstation.circles.budget import Quantity, budgets
from dbbstation.plan.tolerance import CircleFigure
from dbbstation.quality.conformity import Conformity, Size, conformity
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.circled import MeasuredCircle
    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.circles.budget import Budget
    from dbbstation.plan.tolerance import Tolerance


@dataclass(frozen=True)
class ToleratedCircle:
    """Figures of one circle that may have a tolerance.

    Attributes:
        session: name of its session.
        test: name of its test.
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        sizes: by figure; G is that of readings up to 30 undulations per revolution, as in `evaluate`.
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
            _sizes(one.analysis, budgets(one.analysis, one.known)),
        )
        for one in circles
        if one.analysis is not None
    )


def _sizes(one: CircleAnalysis, known: Mapping[Quantity, Budget]) -> dict[CircleFigure, Size]:
    """Sizes with their uncertainties.

    That of G is of G with all its noise, and that of the mean radial error of the radius in the plane of the circle: neither is
    smaller than the figure's own.
    """
    measured = figures(one.raw)
    off = np.array(measured.centre_mm)
    u_centre = np.array([known[Quantity.X].u_um, known[Quantity.Y].u_um])
    # A centre that is not off has no direction: either axis may be the one that counts.
    along = np.abs(off) / np.hypot(*off) if np.any(off) else np.array([1.0, 1.0])
    return {
        CircleFigure.CIRCULAR_DEVIATION: Size(
            smooth_circularity_um(one.raw, one.raw.length_mm), known[Quantity.G].u_um
        ),
        CircleFigure.CENTRE_DEVIATION: Size(measured.centre_deviation_um, float(np.linalg.norm(along * u_centre))),
        CircleFigure.MEAN_RADIAL_ERROR: Size(abs(measured.mean_radial_error_um), known[Quantity.RADIUS].u_um),
    }


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
