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

from dbbstation.nc.splitting import moves_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath

CYCLES = 1.5
"""A piece must be longer than a·L/2 = v² asks for by the way of so many servo cycles, since the planner begins a piece with
a cycle. Without it lines in pieces that fit exactly ran 0.5 % slow, circles at 5 m/s² 12 %."""

KEPT = 1.01
"""A program keeps its feed while it takes no longer than this share of the time of the program that it was made from."""

PLANNED_WITHIN = 0.0015
"""Share of the time by which LinuxCNC may be slower than it is reckoned to be here: 0.0012 at most in the programs of docs/nc.md."""

STOPS = (RowKind.RAPID, RowKind.DWELL, RowKind.PAUSE, RowKind.OPTIONAL_STOP)
"""What a stretch at feed ends at. Rapids are no part of it, and their corners with it are left out."""

LEAST_MM_PER_DEG = 0.1
"""A move that takes the tip less far for each degree is a turn."""

OF_AN_ARC = np.sqrt(3.0) / 2.0
"""Share of the acceleration that LinuxCNC leaves to the direction of arcs in corners (`BLEND_ACC_RATIO_NORMAL`)."""


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
        return cuts(toolpath) & (toolpath.turn_deg > 0.0)

    def speed_mm_s(self, toolpath: Toolpath) -> NDArray[np.float64]:
        """Speed that each row at feed reaches, shape (n,) [mm/s]: F, or less where pieces or the way between stops are short."""
        way_mm = toolpath.tip_mm
        between = np.cumsum(np.isin(toolpath.kind, STOPS))
        stretch_mm = np.bincount(between, weights=way_mm)[between]
        cutting = cuts(toolpath)
        asked = np.where(cutting, toolpath.feed, 60.0) / 60.0
        at_most = np.where(
            self.limited(toolpath), self.reached_mm_s(move_mm(toolpath)), np.sqrt(self.acceleration_mm_s2 * stretch_mm)
        )
        return np.where(cutting, np.minimum(asked, at_most), 1.0)

    def seconds(self, toolpath: Toolpath) -> NDArray[np.float64]:
        """Time of each row, shape (n,) [s]: dwells as written, rapids without, moves at feed with their ramps.

        A stretch is what lies between stops. Where the control looks ahead, it begins and ends with a ramp, and corners are
        rounded by an arc that leaves them by what is allowed. Where not, each piece has its own trapezoid of half the
        acceleration; the next one begins with the shorter of the two ramps between them, or when the corner allows it. The chords of
        an arc are one piece.
        """
        rows = np.flatnonzero(cuts(toolpath))
        seconds = np.where(toolpath.kind == RowKind.RAPID, 0.0, toolpath.duration_s)
        if len(rows) == 0:
            return seconds
        limited, length_mm = self.limited(toolpath)[rows], toolpath.tip_mm[rows]
        speed = self.speed_mm_s(toolpath)[rows]
        ramp_s = speed / self.acceleration_mm_s2 * np.where(limited, 2.0, 1.0)
        # A ramp takes twice the time of its way at full speed.
        seconds[rows] = length_mm / speed + ramp_s
        stops = np.isin(toolpath.kind, STOPS)
        goes_on = np.diff(np.cumsum(stops)[rows]) == 0
        seconds[rows[:-1]] -= np.where(goes_on, self._saved_s(toolpath, rows, speed, ramp_s, limited), 0.0)
        return seconds

    def _saved_s(
        self,
        toolpath: Toolpath,
        rows: NDArray[np.int64],
        speed: NDArray[np.float64],
        ramp_s: NDArray[np.float64],
        limited: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """Time that is saved by not stopping between each of the rows and the next, shape (len(rows) - 1,) [s]."""
        a = self.acceleration_mm_s2
        way = toolpath.poses[rows, :3] - toolpath.before[rows, :3]
        way /= np.linalg.norm(way, axis=1)[:, None]
        half_sine = np.minimum(np.linalg.norm(np.diff(way, axis=0), axis=1) / 2.0, 1.0)
        half_cosine = np.sqrt(1.0 - half_sine**2)
        allowed_mm = np.where(np.isnan(toolpath.corners_mm[rows[:-1]]), np.inf, toolpath.corners_mm[rows[:-1]])
        shorter_mm = np.minimum(toolpath.tip_mm[rows[:-1]], toolpath.tip_mm[rows[1:]])
        ramp = np.minimum(ramp_s[:-1], ramp_s[1:])
        with np.errstate(divide="ignore", invalid="ignore"):
            # Two ramps of a/2 at once leave the corner by v² sin(φ/2) / (2a); an arc of radius R by R (1/cos(φ/2) - 1).
            blended = 2.0 / a * np.sqrt(2.0 * a * allowed_mm / half_sine)
            within = np.fmin(
                allowed_mm * half_cosine / (1.0 - half_cosine), shorter_mm * half_cosine / (2.0 * half_sine)
            )
            corner = np.minimum(np.fmin(np.sqrt(OF_AN_ARC * a * within), np.inf), np.minimum(speed[:-1], speed[1:]))
        lost = sum((each - corner) ** 2 / (2.0 * a * each) for each in (speed[:-1], speed[1:]))
        both = np.maximum((ramp_s[:-1] + ramp_s[1:]) / 2.0 - lost, 0.0)
        saved: NDArray[np.float64] = np.where(limited[:-1] & limited[1:], np.fmin(ramp, blended), both)
        move = moves_of(toolpath)[rows]
        saved = np.where(limited[:-1] & (move[1:] == move[:-1]), ramp, saved)
        # Between a move that turns and one that does not, that one slows down with half its acceleration as well, which is a ramp
        # of v/2a more. They overlap over the way in which the shorter of the two, an arc as one move, gets up to speed: a chord hardly.
        slower = np.minimum(speed[:-1], speed[1:])
        alone = np.minimum(speed, self.reached_mm_s(move_mm(toolpath)[rows]))
        overlap = np.fmin(2.0 * np.minimum(alone[:-1], alone[1:]) ** 2 / (a * slower), blended)
        mixed = overlap - np.where(limited[:-1], speed[1:], speed[:-1]) / (2.0 * a)
        return np.where(limited[:-1] != limited[1:], mixed, saved)


def cuts(toolpath: Toolpath) -> NDArray[np.bool_]:
    """Rows at feed that move the tool tip, apart from turns about a tip that hardly moves, shape (n,).

    How fast those are is a matter of the angles' own acceleration, which is not known here.
    """
    return (toolpath.kind == RowKind.FEED) & (toolpath.tip_mm > LEAST_MM_PER_DEG * toolpath.turn_deg)


def move_mm(toolpath: Toolpath) -> NDArray[np.float64]:
    """Length of the written move that each row belongs to, shape (n,) [mm]: LinuxCNC runs an arc as one."""
    number = moves_of(toolpath)
    return np.asarray(np.bincount(number, weights=toolpath.tip_mm)[number], dtype=np.float64)


LOOKS_AHEAD = Planner(1000.0, None)
"""A control that keeps the feed in pieces of any length."""
