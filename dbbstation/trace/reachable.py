"""Detect false readings by the greatest possible speed of the bar.

In time t the length changes by at most F t (triangle inequality). On the full turn only errors change it. Errors below
the feed-in A with at most n undulations change by at most n A per radian (Bernstein's inequality). With A = 1.5 mm, n =
3, F = 1000 mm/min, radius 150 mm and override, the limit is 0.6 mm/s: 43 um between readings at 14 per second, 2.4 um
at 250. To each limit `SUDDEN_MM` is added. A reading beyond is doubtful unless later readings agree with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.plan.plan import Circle

OVERRIDE = 1.2
"""Greatest feed override of usual controls; other checks detect a wrong feed."""

UNDULATIONS = 3
"""Highest undulations per revolution of errors as large as the feed-in: centre one, tilts and squareness two, struts three."""

SUDDEN_MM = 0.05
"""Largest sudden change between two readings [mm], by backlash at a reversal, friction spikes or vibration: tens of
micrometres on a worn machine, below ten on a calibrated one."""

HALF_WIDTH = float(np.sqrt(3.0))
"""Half-width of a rectangular distribution over its standard deviation [GUM 4.3.7]."""

AGREEING = 3
"""Consecutive doubtful readings that are accepted if they agree with each other."""


@dataclass(frozen=True, slots=True)
class _Seen:
    t_s: float
    length_mm: float
    t_uncertainty_s: float


class Reachable:
    """Tells possible readings from impossible ones, in time order.

    Args:
        circle: None if the bar rests on its calibrator.
    """

    def __init__(self, circle: Circle | None) -> None:
        self._good: _Seen | None = None
        self._doubted: _Seen | None = None
        self._agreeing = 0
        self._off_turn_mm_s = self._on_turn_mm_s = 0.0
        if circle is None:
            return
        feed_mm_s = OVERRIDE * circle.feed_mm_min / 60.0
        self._off_turn_mm_s = feed_mm_s
        across_mm_s = UNDULATIONS * circle.feed_in_mm * float(np.radians(circle.turning_deg_s)) * OVERRIDE
        self._on_turn_mm_s = min(across_mm_s, feed_mm_s)

    def note(self, t_s: float, length_mm: float, t_uncertainty_s: float = 0.0) -> None:
        """Accept a reading without a check, because the speed is unknown."""
        self._believe(_Seen(t_s, length_mm, t_uncertainty_s))

    @classmethod
    def standing(cls, lengths_mm: Floats) -> Flags:
        """Return which readings of a resting bar are possible, shape (n,)."""
        bar = cls(None)
        bar.note(0.0, float(np.median(lengths_mm)))
        return np.array([not bar.doubt(0.0, float(one), on_turn=False) for one in lengths_mm], dtype=np.bool_)

    def doubt(self, t_s: float, length_mm: float, t_uncertainty_s: float = 0.0, *, on_turn: bool) -> str:
        """Return why a reading is impossible, or an empty text.

        Args:
            on_turn: on the full turn, not on its approach.
        """
        one, last = _Seen(t_s, length_mm, t_uncertainty_s), self._good
        if last is None or self._follows(last, one, on_turn=on_turn):
            self._believe(one)
            return ""
        agrees = self._doubted is not None and self._follows(self._doubted, one, on_turn=on_turn)
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._doubted = one
        if self._agreeing >= AGREEING:
            self._believe(one)
            return ""
        return (
            f"{one.length_mm - last.length_mm:+.4f} mm within {1e3 * (one.t_s - last.t_s):.0f} ms, "
            f"at the feed {self._limit_mm(last, one, on_turn=on_turn):.4f} mm are possible"
        )

    def _believe(self, one: _Seen) -> None:
        self._good, self._doubted, self._agreeing = one, None, 0

    def _follows(self, before: _Seen, one: _Seen, *, on_turn: bool) -> bool:
        return abs(one.length_mm - before.length_mm) <= self._limit_mm(before, one, on_turn=on_turn)

    def _limit_mm(self, before: _Seen, one: _Seen, *, on_turn: bool) -> float:
        longest_s = one.t_s - before.t_s + HALF_WIDTH * (one.t_uncertainty_s + before.t_uncertainty_s)
        return (self._on_turn_mm_s if on_turn else self._off_turn_mm_s) * max(longest_s, 0.0) + SUDDEN_MM
