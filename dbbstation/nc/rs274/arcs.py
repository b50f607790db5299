"""The arc of a block, from its centre or radius, its curve, from control points, and both as straight moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.rs274.blocks import ModalGroup, name
from dbbstation.nc.rs274.state import CENTRES
from dbbstation.nc.toolpath import PLANES, on_arc

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.state import ControlState


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


def arc_of(
    block: ProgramBlock,
    state: ControlState,
    target: Floats,
    *,
    clockwise: bool,
    plane: int,
    absolute: bool,
) -> Arc:
    """Return the arc from the control's pose, and remove its words from the block.

    Args:
        absolute: whether the centre counts from the origin (G90.1).

    Raises:
        BadLine: no such arc.
    """
    column, axes, code = block.first_column, PLANES[plane], "G2" if clockwise else "G3"
    radius, letters = block.take("R"), " and ".join(CENTRES[axis] for axis in sorted(axes))
    offsets = [block.take(CENTRES[axis]) for axis in axes]
    other = block.words.get(CENTRES[3 - int(axes.sum())])
    if other is not None and other.value == 0.0 and not absolute:
        del block.words[other.letter]  # as some posts write: the centre lies in the plane
    turns, start = _turns(block), state.pose
    if radius is not None:
        if any(offsets):
            raise block.fault("an arc has R, or I, J and K, not both", "remove one", radius)
        by_radius = centre_by_radius(start[axes], target[axes], radius.value * state.unit_mm, clockwise=clockwise)
        if by_radius is None:
            what = f"no arc of R{radius.value:g} leads from the point before to this one"
            raise block.fault(what, "check R, or write a full turn with its centre", radius)
        return Arc(start, target, by_radius, clockwise=clockwise, turns=turns, plane=plane)
    if not any(offsets):
        raise block.fault(f"{code} needs {letters}, or R", "give the centre", column)
    centre = np.array([0.0 if word is None else word.value * state.unit_mm for word in offsets])
    if not absolute:
        centre += start[axes]
    elif not all(offsets):
        raise block.fault(f"G90.1 needs both {letters}", "give both, or G91.1", column)
    else:
        centre += np.array(state.offset)[axes]
    arc = Arc(start, target, (float(centre[0]), float(centre[1])), clockwise=clockwise, turns=turns, plane=plane)
    if not arc.is_round(state.unit_mm):
        first, last = arc.radii_mm()
        what = f"start and end of the arc lie {first:.4f} and {last:.4f} mm from its centre"
        raise block.fault(what, "check end point and centre", column)
    return arc


def curve_of(block: ProgramBlock, state: ControlState, target: Floats) -> Floats:
    """Return points of a Bézier curve in X and Y whose chords keep `CHORD_ERROR_MM`, shape (k, 6), and remove its words.

    G5.1 is quadratic: I and J lead from the begin to the control point. G5 is cubic: P and Q lead from the end to the
    second control point [LinuxCNC, G5 Cubic Spline and G5.1 Quadratic Spline].

    Raises:
        BadLine: no such curve.
    """
    code = block.codes[ModalGroup.SMOOTHING]
    letters = "IJPQ" if code.value == 5.0 else "IJ"  # noqa: PLR2004
    words = [word.value for letter in letters if (word := block.take(letter)) is not None]
    if len(words) < len(letters):
        what = f"{name('G', code.value)} needs {', '.join(letters)}"
        raise block.fault(what, "give the control points", code)
    offsets = np.array(words).reshape(-1, 2) * state.unit_mm
    begin, end = state.pose[:2], target[:2]
    points = np.array([begin, begin + offsets[0], *(end + offsets[1:]), end])[:, None]
    degree = len(points) - 1
    # A chord leaves the curve by at most an eighth of its second derivative.
    second = degree * (degree - 1) * float(np.linalg.norm(np.diff(points, 2, axis=0), axis=-1).max())
    count = max(1, math.ceil(math.sqrt(second / 8.0 / CHORD_ERROR_MM)))
    share = np.arange(1, count + 1)[:, None] / count
    while len(points) > 1:
        points = (1.0 - share) * points[:-1] + share * points[1:]
    poses = np.tile(target, (count, 1))
    poses[:-1, :2] = points[0, :-1]
    return poses


def _turns(block: ProgramBlock) -> int:
    word = block.take("P")
    if word is None:
        return 1
    if not word.counts(1.0):
        raise block.fault(f"P{word.value:g} is not a number of turns", "give a whole number from 1", word)
    return int(word.value)
