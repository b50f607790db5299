"""Path of a tool's centre beside a programmed contour (G41, G42) in one plane [LinuxCNC, Cutter Compensation].

Points and directions of the plane are complex numbers: the first axis is real, the second imaginary.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.nc.rs274.arcs import Arc

TANGENT_RAD = 0.05
"""A contour that turns by less has no corner. [LinuxCNC's own limit, TOLERANCE_CONCAVE_CORNER]"""


class NoRoomError(Exception):
    """The tool is too large for a corner or an arc."""


@dataclass
class Element:
    """A line or an arc of the contour.

    Attributes:
        begin: on the contour.
        end: on the contour.
        turn: 1 for an arc counter-clockwise, -1 clockwise, 0 for a line.
        centre: of the tool's arc.
        swept_rad: angle that the arc spans.
    """

    begin: complex
    end: complex
    turn: int = 0
    centre: complex = 0.0
    swept_rad: float = 0.0

    def direction(self, point: complex) -> complex:
        """Return the contour's unit direction at its begin or end."""
        way = self.turn * 1j * (point - self.centre) if self.turn else self.end - self.begin
        return way / abs(way)


@dataclass(frozen=True)
class Beside:
    """The tool's path beside the last element. The next corner may still shorten it.

    Attributes:
        added: number of its rows in the toolpath.
        start: of the tool's centre, shape (6,).
        end: likewise.
        plane: its two axes, shape (2,).
    """

    element: Element
    added: int
    start: Floats
    end: Floats
    plane: Integers
    arc: Arc | None

    @property
    def place(self) -> complex:
        """Return the end point of the element in the plane."""
        return complex(*self.end[self.plane])

    def bent(self, place: complex) -> tuple[Floats, tuple[float, float, float, float]]:
        """Return the poses of the path, and the arc of its chords, for another end point in the plane.

        Raises:
            NoRoomError: it would run backwards.
        """
        end = with_plane(self.end, self.plane, place)
        arc = None if self.arc is None else replace(self.arc, end=end, pieces=self.arc.chords)
        replace(self, end=end, arc=arc).check(0.0 if self.arc is None else self.arc.swept_rad)
        return (end[None], (0.0, 0.0, 0.0, 0.0)) if arc is None else (arc.poses(), arc.chord)

    def check(self, swept_rad: float) -> None:
        """Check that a line runs forwards, and that an arc spans no more than before.

        Raises:
            NoRoomError: it does not.
        """
        if self.arc is not None and self.arc.swept_rad > swept_rad + TANGENT_RAD:
            raise NoRoomError
        way = self.place - complex(*self.start[self.plane])
        if self.arc is None and (way * (self.element.end - self.element.begin).conjugate()).real < 0.0:
            raise NoRoomError


def with_plane(pose: Floats, plane: Integers, place: complex) -> Floats:
    """Return a pose, shape (6,), with another position in a plane."""
    there = pose.copy()
    there[plane] = place.real, place.imag
    return there


def element_of(begin: complex, end: complex, arc: Arc | None) -> Element:
    """Return the element of a contour between two points."""
    if arc is None:
        return Element(begin, end)
    return Element(begin, end, -1 if arc.clockwise else 1, complex(*arc.centre_mm), arc.swept_rad)


@dataclass(frozen=True)
class Cutter:
    """A tool beside a contour.

    Attributes:
        side: 1 left of it, -1 right of it.
    """

    side: int
    radius_mm: float

    def beside(self, element: Element, point: complex) -> complex:
        """Return the tool's centre beside the begin or end of an element."""
        return point + self.side * self.radius_mm * 1j * element.direction(point)

    def check_entry(self, begin: complex, end: complex) -> None:
        """Check that the entry into a contour is longer than the radius.

        Raises:
            NoRoomError: it is not.
        """
        if abs(end - begin) <= self.radius_mm:
            raise NoRoomError

    def reaches(self, element: Element) -> float:
        """Return the radius of the tool's arc [mm].

        Raises:
            NoRoomError: the tool does not fit inside.
        """
        radius = abs(element.end - element.centre) - self.side * element.turn * self.radius_mm
        if radius <= 0.0:
            raise NoRoomError
        return radius

    def entered(self, arc: Element, begin: complex) -> Element:
        """Return the arc from the tool's centre to the point beside the end of an arc, tangent to that end."""
        end = self.beside(arc, arc.end)
        inwards = (arc.centre - arc.end) / abs(arc.centre - arc.end)
        chord = begin - end
        share = (chord * inwards.conjugate()).real
        if share <= TANGENT_RAD * abs(chord):  # it would turn the other way
            raise NoRoomError
        return Element(arc.begin, arc.end, arc.turn, end + inwards * abs(chord) ** 2 / (2.0 * share))

    def is_inside(self, element: Element) -> bool:
        """Return whether the tool runs inside an arc."""
        return self.side * element.turn > 0

    def corner(self, last: Element, element: Element) -> tuple[complex, bool]:
        """Return the point where the tool's centre passes to the next element, and whether it first goes round the corner.

        Raises:
            NoRoomError: the tool does not fit into the corner.
        """
        turned = self.side * cmath.phase(last.direction(last.end) / element.direction(element.begin))
        turned += math.tau if turned < -math.pi / 2.0 else 0.0
        back = abs(turned - math.pi) < TANGENT_RAD
        other = not self.is_inside(element) if element.turn else bool(last.turn) and not self.is_inside(last)
        if turned < -TANGENT_RAD or turned > math.pi + TANGENT_RAD or (back and other):
            return self._meeting(last, element), False
        return self.beside(last, last.end), turned > TANGENT_RAD

    def _meeting(self, last: Element, element: Element) -> complex:
        if last.turn and element.turn:
            return self._of_arcs(last, element)
        if last.turn or element.turn:
            return self._of_line_and_arc(last, element)
        way, other = last.direction(last.end), element.direction(element.begin)
        apart = self.beside(element, element.begin) - self.beside(last, last.end)
        across = (way.conjugate() * other).imag
        if across == 0.0:
            raise NoRoomError
        return self.beside(last, last.end) + way * (apart.conjugate() * other).imag / across

    def _of_line_and_arc(self, last: Element, element: Element) -> complex:
        arc, line = (last, element) if last.turn else (element, last)
        # An arc begins on the circle through its end, even if rounding puts it beside.
        radii = abs(arc.end - arc.centre) / abs(arc.begin - arc.centre)
        point = line.begin if last.turn else arc.centre + (arc.begin - arc.centre) * radii
        way, place = line.direction(point), self.beside(line, point)
        foot = place + way * ((arc.centre - place) * way.conjugate()).real
        radius = self._tool_radius(arc, of_last=bool(last.turn))
        half = radius**2 - abs(foot - arc.centre) ** 2
        if half < 0.0:
            raise NoRoomError
        # Inside an arc the farther meeting is its entry and the nearer its exit; outside, the other way round.
        forward = 1.0 if self.is_inside(arc) == bool(element.turn) else -1.0
        return foot + forward * math.sqrt(half) * way

    def _of_arcs(self, last: Element, element: Element) -> complex:
        radius, other = self._tool_radius(last, of_last=True), self._tool_radius(element, of_last=False)
        apart = element.centre - last.centre
        if radius == 0.0 or apart == 0.0:
            raise NoRoomError
        share = (radius**2 + abs(apart) ** 2 - other**2) / (2.0 * radius * abs(apart))
        if abs(share) > 1.0:
            raise NoRoomError
        left = 1.0 if self.is_inside(last) == (element.turn > 0) else -1.0
        return last.centre + radius * cmath.exp(1j * left * math.acos(share)) * apart / abs(apart)

    def _tool_radius(self, arc: Element, *, of_last: bool) -> float:
        return abs(self.beside(arc, arc.end) - arc.centre) if of_last else self.reaches(arc)
