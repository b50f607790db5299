"""The feed that a control reaches in pieces of a given length.

LinuxCNC 2.9 (`src/emc/tp`) does not look ahead if A, B or C move (`tcRotaryMotionCheck`). It plans such a piece from
standstill to standstill with half the acceleration, and overlaps successive pieces. A piece of length L then reaches v²
= a·L/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.splitting import moves_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.nc.toolpath import Toolpath

CYCLES = 1.5
"""A piece must be longer than a·L/2 = v² requires, by the distance of this many servo cycles, because the planner begins each piece with a cycle. Without this addition lines ran 0.5 % slow, and circles at 5 m/s² 12 %."""

CYCLE_S = 0.001
"""Servo period that is usual [s]."""

LEAST_MM_PER_DEG = 0.1
"""A move that moves the tip less than this per degree is a turn."""


@dataclass(frozen=True)
class LookAhead:
    """How far a control looks ahead in moves that turn A, B or C.

    Attributes:
        share: of a·L that v² reaches in a piece of length L [1]; infinite: it keeps the feed in pieces of any length.
    """

    share: float
    cycle_s: float = CYCLE_S


@dataclass(frozen=True)
class Planner:
    """A control on a machine."""

    acceleration_mm_s2: float
    look_ahead: LookAhead | None

    def needed_mm(self, mm_s: Floats) -> Floats:
        """Return the lengths of turning pieces that reach these speeds, same shape [mm]."""
        if self.look_ahead is None:
            return np.zeros_like(mm_s)
        least = mm_s**2 / (self.look_ahead.share * self.acceleration_mm_s2)
        return least + CYCLES * self.look_ahead.cycle_s * mm_s

    def reached_mm_s(self, length_mm: Floats) -> Floats:
        """Return the speeds of turning pieces of these lengths, same shape [mm/s]."""
        if self.look_ahead is None:
            return np.full_like(length_mm, np.inf)
        a = self.look_ahead.share * self.acceleration_mm_s2
        lost = CYCLES * self.look_ahead.cycle_s * a
        return (np.sqrt(lost**2 + 4.0 * a * length_mm) - lost) / 2.0

    def row_mm_s(self, toolpath: Toolpath) -> Floats:
        """Return the speed of each row at feed that moves the tip, F or less, shape (n,) [mm/s]; infinite in other rows."""
        turning = cuts(toolpath) & (toolpath.turn_deg > 0.0)
        reached = np.where(turning, self.reached_mm_s(move_mm(toolpath)), np.inf)
        return np.where(cuts(toolpath), np.minimum(toolpath.feed / 60.0, reached), np.inf)

    def seconds(self, toolpath: Toolpath) -> float:
        """Return the time of all rows at feed, without ramps at stops and corners [s]."""
        turns = (toolpath.kind == RowKind.FEED) & ~cuts(toolpath)
        cutting_s = toolpath.tip_mm / self.row_mm_s(toolpath)
        return float(np.where(turns, toolpath.duration_s, cutting_s).sum())


def cuts(toolpath: Toolpath) -> Flags:
    """Return the rows at feed that move the tool tip, shape (n,)."""
    return (toolpath.kind == RowKind.FEED) & (toolpath.tip_mm > LEAST_MM_PER_DEG * toolpath.turn_deg)


def move_mm(toolpath: Toolpath) -> Floats:
    """Return the length of each row's written move, shape (n,) [mm]. LinuxCNC runs an arc as one move."""
    number = moves_of(toolpath)
    return np.asarray(np.bincount(number, weights=toolpath.tip_mm)[number], dtype=np.float64)


LOOKS_AHEAD = Planner(1000.0, None)
"""Look-ahead of a control that keeps the feed in pieces of any length."""
