"""What a control's trajectory planner makes of pieces: the feed that it reaches in them, and the time that they take.

LinuxCNC's planner (2.9, `src/emc/tp`) neither looks ahead nor fits arcs into corners where A, B or C move
(`tcRotaryMotionCheck`). It plans such a piece from standstill to standstill with half the acceleration, and lets the next
one begin when this one starts to slow down; the other half of the acceleration is for that. A piece of length L then
reaches v² = a·L/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.toolpath import Step

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath

CYCLES = 1.5
"""A piece must be longer than a·L/2 = v² asks for by the way of so many servo cycles, since the planner begins a piece with
a cycle. Without it lines in pieces that fit exactly ran 0.5 % slow, circles at 5 m/s² 12 %."""

KEPT = 1.01
"""A program keeps its feed while it takes no longer than this share of the time of the program that it was made from."""


@dataclass(frozen=True)
class LookAhead:
    """How far a control looks ahead in moves that turn A, B or C.

    Attributes:
        share: of a·L that v² reaches in a piece of length L [1].
        cycle_s: servo period [s].
    """

    share: float
    cycle_s: float = 0.001


@dataclass(frozen=True)
class Planner:
    """A control on a machine.

    Attributes:
        acceleration_mm_s2: of the tool tip.
        look_ahead: of the control where A, B or C move; None: as far as it needs to.
    """

    acceleration_mm_s2: float
    look_ahead: LookAhead | None

    def needed_mm(self, mm_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Length of a piece with turning axes that reaches these speeds, same shape [mm]."""
        if self.look_ahead is None:
            return np.zeros_like(mm_s)
        least = mm_s**2 / (self.look_ahead.share * self.acceleration_mm_s2)
        needed: NDArray[np.float64] = least + CYCLES * self.look_ahead.cycle_s * mm_s
        return needed

    def reached_mm_s(self, length_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Speeds that pieces with turning axes of these lengths reach, same shape; the inverse of `needed_mm` [mm/s]."""
        if self.look_ahead is None:
            return np.full_like(length_mm, np.inf)
        a = self.look_ahead.share * self.acceleration_mm_s2
        lost = CYCLES * self.look_ahead.cycle_s * a
        reached: NDArray[np.float64] = (np.sqrt(lost**2 + 4.0 * a * length_mm) - lost) / 2.0
        return reached

    def limited(self, toolpath: Toolpath) -> NDArray[np.bool_]:
        """Rows at feed that move the tool tip and turn A, B or C, in which the control does not look ahead, shape (n,)."""
        if self.look_ahead is None:
            return np.zeros(len(toolpath), dtype=np.bool_)
        return (toolpath.kind == Step.FEED) & (toolpath.tip_mm > 0.0) & (toolpath.turn_deg > 0.0)

    def seconds(self, toolpath: Toolpath) -> NDArray[np.float64]:
        """Time of each row, shape (n,) [s]: dwells as written, rapids without, moves at feed with their ramps.

        A stretch is what lies between stops. Where the control looks ahead, it begins and ends with a ramp, and corners
        are taken at the feed. Where not, each piece has its own trapezoid of half the acceleration, and the next one begins
        when the slower of the two ramps between them does.
        """
        moving = (toolpath.kind == Step.FEED) & (toolpath.tip_mm > 0.0)
        rows = np.flatnonzero(moving)
        seconds = np.where(toolpath.kind == Step.RAPID, 0.0, toolpath.duration_s)
        if len(rows) == 0:
            return seconds
        limited = self.limited(toolpath)[rows]
        feed_mm_s, length_mm = toolpath.feed[rows] / 60.0, toolpath.tip_mm[rows]
        speed = np.where(limited, np.minimum(feed_mm_s, self.reached_mm_s(length_mm)), feed_mm_s)
        ramp_s = speed / self.acceleration_mm_s2 * np.where(limited, 2.0, 1.0)
        stops = np.isin(toolpath.kind, [Step.RAPID, Step.DWELL, Step.PAUSE])
        stretch = np.cumsum(stops)[rows]
        ends = np.append(stretch[1:] != stretch[:-1], True)
        between_s = np.append(np.minimum(ramp_s[1:], ramp_s[:-1]), 0.0)
        # A ramp takes twice the time of its way at full speed; between two moves the next one begins as it does.
        alone = length_mm / speed + ramp_s
        seconds[rows] = alone - np.where(ends, 0.0, between_s)
        return seconds


LOOKS_AHEAD = Planner(1000.0, None)
"""A control that keeps the feed in pieces of any length."""
