"""The feed and time that a control's trajectory planner makes of pieces.

LinuxCNC 2.9 (`src/emc/tp`) neither looks ahead nor fits arcs into corners if A, B or C move (`tcRotaryMotionCheck`). It
plans such a piece from standstill to standstill with half the acceleration and overlaps it with the next. A piece of
length L then reaches v² = a·L/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.merging import queued
from dbbstation.nc.planned_time import OF_AN_ARC, STANDS, arc_radius_mm, seconds_of, segments_of
from dbbstation.nc.splitting import moves_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath

CYCLES = 1.5
"""A piece must be longer than a·L/2 = v² asks for by the way of so many servo cycles, since the planner begins a piece with
a cycle. Without it lines in pieces that fit exactly ran 0.5 % slow, circles at 5 m/s² 12 %."""

CYCLE_S = 0.001
"""Servo period that is usual [s]."""

KEPT = 1.01
"""A program keeps its feed while it takes no longer than this share of the time of the program that it was made from."""

PLANNED_WITHIN = 0.0015
"""Share of the time by which LinuxCNC may be slower than it is reckoned to be here: 0.0012 where it was reckoned more coarsely [docs/validation.md]."""

STOPS = (RowKind.RAPID, *STANDS)
"""What a stretch at feed ends at: LinuxCNC stops between a rapid and a move at feed [`handleModeChange` in `src/emc/tp/tp.c`]."""

LEAST_MM_PER_DEG = 0.1
"""A move that takes the tip less far for each degree is a turn."""


@dataclass(frozen=True)
class LookAhead:
    """How far a control looks ahead in moves that turn A, B or C.

    Attributes:
        share: of a·L that v² reaches in a piece of length L [1].
    """

    share: float
    cycle_s: float = CYCLE_S


@dataclass(frozen=True)
class Planner:
    """A control on a machine.

    Attributes:
        look_ahead: in moves of A, B or C; None: unlimited.
    """

    acceleration_mm_s2: float
    look_ahead: LookAhead | None

    def needed_mm(self, mm_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the length of a turning piece that reaches these speeds, same shape [mm]."""
        if self.look_ahead is None:
            return np.zeros_like(mm_s)
        least = mm_s**2 / (self.look_ahead.share * self.acceleration_mm_s2)
        needed: NDArray[np.float64] = least + CYCLES * self.look_ahead.cycle_s * mm_s
        return needed

    def reached_mm_s(self, length_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the speeds of turning pieces of these lengths, same shape [mm/s]."""
        if self.look_ahead is None:
            return np.full_like(length_mm, np.inf)
        a = self.look_ahead.share * self.acceleration_mm_s2
        lost = CYCLES * self.look_ahead.cycle_s * a
        reached: NDArray[np.float64] = (np.sqrt(lost**2 + 4.0 * a * length_mm) - lost) / 2.0
        return reached

    def limited(self, toolpath: Toolpath) -> NDArray[np.bool_]:
        """Return the rows at feed without look-ahead, shape (n,)."""
        if self.look_ahead is None:
            return np.zeros(len(toolpath), dtype=np.bool_)
        return cuts(toolpath) & (toolpath.turn_deg > 0.0)

    def speed_mm_s(self, toolpath: Toolpath) -> NDArray[np.float64]:
        """Return the speed of each row at feed, F or less, shape (n,) [mm/s]."""
        way_mm = toolpath.tip_mm
        between = np.cumsum(np.isin(toolpath.kind, STOPS))
        stretch_mm = np.bincount(between, weights=way_mm)[between]
        cutting = cuts(toolpath)
        asked = np.minimum(np.where(cutting, toolpath.feed, 60.0) / 60.0, self.turning_mm_s(toolpath))
        at_most = np.where(
            self.limited(toolpath), self.reached_mm_s(move_mm(toolpath)), np.sqrt(self.acceleration_mm_s2 * stretch_mm)
        )
        return np.where(cutting, np.minimum(asked, at_most), 1.0)

    def turning_mm_s(self, toolpath: Toolpath) -> NDArray[np.float64]:
        """Return the greatest speed in each row's arc, infinite in straight rows, shape (n,) [mm/s]."""
        if self.look_ahead is None:
            return np.full(len(toolpath), np.inf)
        return np.sqrt(OF_AN_ARC * self.acceleration_mm_s2 * arc_radius_mm(toolpath))

    def seconds(self, toolpath: Toolpath, *, in_chords: bool = False) -> NDArray[np.float64]:
        """Return the time of each row, shape (n,) [s]: dwells as written, rapids zero, moves at feed with ramps.

        See `planned_time`. `in_chords`: arcs are written as chords, as in compensated programs.
        """
        one = queued(toolpath)
        if one is not None:
            return np.asarray(one.share * self.seconds(one.path, in_chords=in_chords)[one.of], dtype=np.float64)
        rows = np.flatnonzero(cuts(toolpath))
        seconds = np.where(toolpath.kind == RowKind.RAPID, 0.0, toolpath.duration_s)
        if len(rows) == 0:
            return seconds
        a = self.acceleration_mm_s2
        segments = segments_of(toolpath, rows, self.limited(toolpath), a, in_chords=in_chords)
        cycle_s = CYCLE_S if self.look_ahead is None else self.look_ahead.cycle_s
        seconds[rows] = seconds_of(segments, a, cycle_s, self.reached_mm_s(segments.length_mm))
        return seconds


def cuts(toolpath: Toolpath) -> NDArray[np.bool_]:
    """Return the rows at feed that move the tool tip, shape (n,).

    Turns about a resting tip depend on the angles' acceleration, which is not known.
    """
    return (toolpath.kind == RowKind.FEED) & (toolpath.tip_mm > LEAST_MM_PER_DEG * toolpath.turn_deg)


def move_mm(toolpath: Toolpath) -> NDArray[np.float64]:
    """Return the length of each row's written move, shape (n,) [mm]: LinuxCNC runs an arc as one."""
    number = moves_of(toolpath)
    return np.asarray(np.bincount(number, weights=toolpath.tip_mm)[number], dtype=np.float64)


LOOKS_AHEAD = Planner(1000.0, None)
"""A control that keeps the feed in pieces of any length."""
