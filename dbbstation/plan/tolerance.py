"""The shop's limits for figures of circles."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.plan.plan import Direction


class CircleFigure(StrEnum):
    """Figures of a circle that may have a tolerance."""

    CIRCULAR_DEVIATION = "circular-deviation"
    """G: greatest minus least deviation from the least-squares circle [ISO 230-4 3.2]."""
    CENTRE_DEVIATION = "centre-deviation"
    """Distance between the least-squares centre and the commanded one [CAL Table III]."""
    MEAN_RADIAL_ERROR = "mean-radial-error"
    """Size of the mean bar length about the commanded centre less the nominal length [CAL Table III]."""
    RADIAL_DEVIATION = "radial-deviation"
    """F: the larger of |Fmax| and |Fmin| about the least-squares centre [ISO 230-4]."""
    BIDIRECTIONAL_CIRCULAR_DEVIATION = "bidirectional-circular-deviation"
    """G(b): greatest minus least deviation of both directions from their common least-squares circle [ISO 230-4]."""
    MEAN_BIDIRECTIONAL_RADIAL_DEVIATION = "mean-bidirectional-radial-deviation"
    """D: size of the difference between the common least-squares radius of both directions and the nominal radius [ISO 230-4]."""
    CIRCULAR_HYSTERESIS = "circular-hysteresis"
    """H: greatest radial difference between both directions at one angle [ISO 230-4:1996]."""


OF_A_MODEL = (CircleFigure.CIRCULAR_DEVIATION, CircleFigure.CENTRE_DEVIATION, CircleFigure.MEAN_RADIAL_ERROR)
"""Figures that summaries give for every circle and that a model predicts."""

OF_BOTH_DIRECTIONS = frozenset(CircleFigure) - {*OF_A_MODEL, CircleFigure.RADIAL_DEVIATION}
"""Figures computed from both directions of a test."""

FILTERED = frozenset(
    {
        CircleFigure.CIRCULAR_DEVIATION,
        CircleFigure.RADIAL_DEVIATION,
        CircleFigure.BIDIRECTIONAL_CIRCULAR_DEVIATION,
        CircleFigure.CIRCULAR_HYSTERESIS,
    }
)
"""Figures that a filter changes."""

USUAL_UPR = 30
"""Filter of a tolerance without a stated filter: a sharp cut-off at 30 undulations per revolution, as in predictions."""


@dataclass(frozen=True)
class Tolerance:
    """A limit for one figure of some circles.

    Attributes:
        upr: filter cut-off in undulations per revolution, for figures in `FILTERED`; 0 for none.
    """

    figure: CircleFigure
    largest_um: float
    tests: tuple[str, ...] = ()
    directions: tuple[Direction, ...] = ()
    upr: int = USUAL_UPR

    def holds_for(self, test: str, direction: str) -> bool:
        """Return whether the limit applies to a test and direction."""
        return (not self.tests or test in self.tests) and (not self.directions or direction in self.directions)


@dataclass(frozen=True)
class Worst:
    """The circle with the largest figure, compared with its tolerance."""

    tolerance: Tolerance
    run: str
    size_um: float

    @property
    def within(self) -> bool:
        """Return whether the figure is within the limit."""
        return self.size_um <= self.tolerance.largest_um


def worst(tolerance: Tolerance, runs: Iterable[tuple[str, str, int, Mapping[CircleFigure, float]]]) -> Worst | None:
    """Return the run with the largest applicable figure, or None."""
    held = [
        Worst(tolerance, f"{test}-{direction}-{repeat}", abs(figures[tolerance.figure]))
        for test, direction, repeat, figures in runs
        if tolerance.holds_for(test, direction)
    ]
    return max(held, key=lambda one: one.size_um, default=None)
