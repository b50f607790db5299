"""Lengths that the bar can have, by how fast the machine moves it: what a line without a checksum may have made up shows here.

The fixed ball stands and the tool tip moves with the feed F, so between two readings the distance of the balls changes by no more
than F times their time apart, whatever the machine's errors are (triangle inequality). On the full turn the machine moves across
the bar, and what changes the length there are its errors alone. They stay within the feed-in A (a turn that leaves it is refused)
and are mostly made of few undulations: a curve of no more than n undulations per revolution that stays within A changes by no more
than n A per radian (Bernstein's inequality). With A = 1.5 mm, n = 3, F = 1000 mm/min and a radius of 150 mm these are 0.6 mm in a
second, with the override: 43 um from one reading of a display (14 per second) to the next, 2.4 um at 250 readings per second.

To both comes what a machine does at once. A reading beyond is doubtful, unless the ones behind it agree with it: then the bar did
move, was hit or left its seat, which other checks find and say.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle

OVERRIDE = 1.2
"""Greatest feed override of usual controls: a machine that runs faster than programmed is for others to notice."""

UNDULATIONS = 3
"""Per revolution, of the errors that are as large as the feed-in: centre and scale one, tilts and squareness two, struts three."""

SUDDEN_MM = 0.05
"""What a machine does between two readings however near: backlash at a reversal, a spike of friction, vibration [mm]. Tens of
micrometres at a worn machine; calibrated ones stay below ten."""

AGREEING = 3
"""Readings in a row that agree with each other and not with those before: then it was the bar."""


class Reachable:
    """Tells lengths that the bar can have from others, from readings in time order.

    Args:
        circle: as commanded; None: nothing moves the bar, it is on its calibrator.
    """

    def __init__(self, circle: Circle | None) -> None:
        self._good: tuple[float, float] | None = None
        self._doubted: tuple[float, float] | None = None
        self._agreeing = 0
        self._off_turn_mm_s = self._on_turn_mm_s = 0.0
        if circle is None:
            return
        feed_mm_s = OVERRIDE * circle.feed_mm_min / 60.0
        self._off_turn_mm_s = feed_mm_s
        across_mm_s = UNDULATIONS * circle.feed_in_mm * float(np.radians(circle.turning_deg_s)) * OVERRIDE
        self._on_turn_mm_s = min(across_mm_s, feed_mm_s)

    def note(self, t_s: float, length_mm: float) -> None:
        """Take a reading that is held against nothing, while nobody knows how fast the bar is moved.

        Args:
            t_s: its time [s].
            length_mm: it [mm].
        """
        self._good, self._doubted, self._agreeing = (t_s, length_mm), None, 0

    @classmethod
    def standing(cls, lengths_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which readings of a bar that stands can be its length, shape (n,).

        Args:
            lengths_mm: in time order, shape (n,) [mm].
        """
        bar = cls(None)
        bar.note(0.0, float(np.median(lengths_mm)))
        return np.array([not bar.doubt(0.0, float(one), on_turn=False) for one in lengths_mm], dtype=np.bool_)

    def doubt(self, t_s: float, length_mm: float, *, on_turn: bool) -> str:
        """Return why a reading cannot be the bar's length; empty where it can.

        Args:
            t_s: its time [s].
            length_mm: it [mm].
            on_turn: the machine is on the full turn, not on its way to the circle or from it.
        """
        reading = (t_s, length_mm)
        if self._good is None or self._follows(self._good, reading, on_turn=on_turn):
            self.note(t_s, length_mm)
            return ""
        agrees = self._doubted is not None and self._follows(self._doubted, reading, on_turn=on_turn)
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._doubted = reading
        if self._agreeing >= AGREEING:
            self.note(t_s, length_mm)
            return ""
        last_s, last_mm = self._good
        apart_s = t_s - last_s
        return (
            f"{length_mm - last_mm:+.4f} mm within {1e3 * apart_s:.0f} ms, at the feed {self._limit_mm(apart_s, on_turn=on_turn):.4f} mm "
            "are possible"
        )

    def _follows(self, before: tuple[float, float], reading: tuple[float, float], *, on_turn: bool) -> bool:
        return abs(reading[1] - before[1]) <= self._limit_mm(reading[0] - before[0], on_turn=on_turn)

    def _limit_mm(self, apart_s: float, *, on_turn: bool) -> float:
        """Return by how much the length may change within a time [mm]."""
        return (self._on_turn_mm_s if on_turn else self._off_turn_mm_s) * max(apart_s, 0.0) + SUDDEN_MM
