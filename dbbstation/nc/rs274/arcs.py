"""Arcs and helices in a plane as straight moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.toolpath import PLANES, on_arc

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

CHORD_ERROR_MM = 5e-5
"""Largest distance of a chord from its arc: 0.05 µm, or 3800 chords for a full turn of 150 mm."""

RADIUS_ABSOLUTE_MM = {1.0: 0.02 * math.sqrt(2.0), 25.4: 0.0508 * math.sqrt(2.0)}
RADIUS_RELATIVE, RADIUS_WORST = 1e-3, 100.0
"""Limits of the difference between the radii to start and end of an arc. The difference may reach the first limit for
the program's unit. It may also reach the second times the radius, but at most the third times the first. Such an arc is
a spiral. [LinuxCNC's own limits]"""

LEAST_RADIUS_MM = 0.00127
"""Arcs with a smaller radius are invalid. [LinuxCNC's own limit, RADIUS_TOLERANCE]"""

REACH_MM = 0.00127
"""Largest amount by which R may be too short for the ends of its arc. [LinuxCNC's own limit]"""

FULL_TURN_RAD = 1e-6
"""An arc with a smaller angle between start and end is a full turn. [LinuxCNC's own limit]"""


@dataclass(frozen=True)
class Arc:
    """An arc in a plane; all other axes move evenly along it.

    Attributes:
        start: pose before it, shape (6,) [mm, deg].
        end: pose after it, shape (6,) [mm, deg].
        centre_mm: in first and second axis of its plane.
        clockwise: seen from the positive end of the third axis.
        turns: each above 1 adds a full turn.
        pieces: number of chords; 0: as many as `CHORD_ERROR_MM` needs.
    """

    start: Floats
    end: Floats
    centre_mm: tuple[float, float]
    clockwise: bool
    turns: int = 1
    plane: int = 0
    pieces: int = 0

    def radii_mm(self) -> tuple[float, float]:
        """Return distances of start and end from the centre [mm]."""
        plane = PLANES[self.plane]
        return math.dist(self.start[plane], self.centre_mm), math.dist(self.end[plane], self.centre_mm)

    def is_round(self, unit_mm: float) -> bool:
        """Return whether both ends lie on one circle within LinuxCNC's tolerance."""
        first, last = self.radii_mm()
        off, radius, allowed_mm = abs(first - last), max(first, last), RADIUS_ABSOLUTE_MM[unit_mm]
        if min(first, last) < LEAST_RADIUS_MM or off > allowed_mm * RADIUS_WORST:
            return False
        return off <= allowed_mm or off <= RADIUS_RELATIVE * radius

    @property
    def swept_rad(self) -> float:
        """Return the angle from start to end in the arc's direction, over all turns."""
        plane = PLANES[self.plane]
        begin, end = (math.atan2(*(pose[plane] - self.centre_mm)[::-1]) for pose in (self.start, self.end))
        swept = math.fmod(end - begin if not self.clockwise else begin - end, math.tau)
        while swept <= FULL_TURN_RAD:
            swept += math.tau
        return swept + (self.turns - 1) * math.tau

    @property
    def chords(self) -> int:
        """Return the number of straight moves that keep `CHORD_ERROR_MM`."""
        return self.pieces or max(1, math.ceil(self.swept_rad / math.sqrt(8.0 * CHORD_ERROR_MM / max(self.radii_mm()))))

    @property
    def chord(self) -> tuple[float, float, float, float]:
        """Return a row of `Toolpath.arc`."""
        turned = -self.swept_rad if self.clockwise else self.swept_rad
        return *self.centre_mm, turned / self.chords, float(self.plane)

    @property
    def length_mm(self) -> float:
        """Return the tip's path length along the arc, including its rise [mm]."""
        flat = self.swept_rad * sum(self.radii_mm()) / 2.0
        rise = 3 - int(PLANES[self.plane].sum())
        return math.hypot(flat, float(self.end[rise] - self.start[rise]))

    def poses(self) -> Floats:
        """Return end points of the chords, shape (k, 6) [mm, deg]."""
        turned = -self.swept_rad if self.clockwise else self.swept_rad
        share, plane = np.arange(1, self.chords + 1) / self.chords, PLANES[self.plane]
        poses = self.start + share[:, None] * (self.end - self.start)
        ends = self.start[None, plane], self.end[None, plane]
        poses[:, plane] = on_arc(*ends, np.array([[*self.centre_mm, turned]]), share)
        poses[-1] = self.end
        return poses


def centre_by_radius(
    start: Floats,
    end: Floats,
    radius_mm: float,
    *,
    clockwise: bool,
) -> tuple[float, float] | None:
    """Return the centre of the arc through two points of its plane, shapes (2,); None if R is too short or both are equal.

    Args:
        radius_mm: positive for at most half a turn, negative for more.
    """
    dx, dy = float(end[0] - start[0]), float(end[1] - start[1])
    half = math.hypot(dx, dy) / 2.0
    if half == 0.0 or half - abs(radius_mm) > REACH_MM:
        return None
    height = math.sqrt(max(radius_mm**2 - half**2, 0.0))
    # Left of the chord lies the centre of a short counter-clockwise arc, and of a long clockwise one.
    side = 1.0 if clockwise == (radius_mm < 0.0) else -1.0
    scale = side * height / (2.0 * half)
    return float(start[0] + end[0]) / 2.0 - dy * scale, float(start[1] + end[1]) / 2.0 + dx * scale
