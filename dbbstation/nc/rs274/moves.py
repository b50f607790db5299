"""Moves, arcs and cycles of a block."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.rs274.blocks import CURVES, CYCLES, TAPS, ModalGroup, name
from dbbstation.nc.rs274.state import AXES, CENTRES, unknown_place, unplaced
from dbbstation.nc.toolpath import (
    IN_FORCE,
    LEAST_MM,
    PLANES,
    RowKind,
    bits_of,
    lengths,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.arcs import Arc
    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.cutter import Cutter, Element
    from dbbstation.nc.rs274.tokens import BadLine, Word

from dbbstation.nc.rs274.modes import ARCS, CLOCKWISE, LINEAR, MACHINE, POLAR, RAPID, TAKES_AXES, Feed, Modes

MOST_ROWS = 4_000_000
"""Greatest number of moves and stops after arcs are divided into chords: 1000 full turns of 150 mm, or a path of 200 m in
steps of 0.05 mm. Rows take 0.4 GB of a temporary file."""

FARTHEST_MM, FARTHEST_DEG = 100_000.0, 36_000.0
"""Largest coordinates that increments may reach, equal to the largest numbers of a program."""

FARTHEST = (*[FARTHEST_MM] * 3, *[FARTHEST_DEG] * 3)

FLOATING = "G74 and G84 tap with a floating chuck, as in LinuxCNC: the spindle turns back at the bottom, and F is kept"

LEAST_F = 1e-3
"""Feed of a move of zero length under G93."""


class Moves(Modes):
    """Adds moves to the toolpath."""

    def _rapid(self, block: ProgramBlock, target: Floats, axes: list[int], *, in_machine: bool = False) -> None:
        self._begin_move(block, target)
        unknown = (self.path.unknown & ~sum(1 << axis for axis in axes)) | bits_of(np.isnan(target))
        self.path.rapid(target, line=block.place.line, in_machine=in_machine, unknown=unknown)
        self._state.pose = target

    def _go_to(self, block: ProgramBlock, named: list[str], *, in_machine: bool) -> None:
        if self._motion is None:
            what = f"{named[0]} without a motion code"
            raise block.fault(what, "write G0 or G1 before it")
        if self._since_cycle:
            self.path.notes += (f"{block.place}: {named[0]} behind G80 is taken for a rapid, as before the cycle",)
            self._since_cycle = False
        target = self._target(block, in_machine=in_machine)
        if self._cutter is not None:
            self._go_beside(self._cutter, block, target)
        elif self._motion == RAPID:
            self._rapid(block, target, [AXES.index(letter) for letter in named], in_machine=in_machine)
        elif self._motion == LINEAR:
            way = target - self._state.pose
            length = float(np.linalg.norm(way[:3])), float(np.linalg.norm(way[3:]))
            self._cut(block, target[None], length, in_machine=in_machine)
        else:
            arc = self._arc(block, target)
            self._cut(block, arc.poses(), (arc.length_mm, 0.0), arc=arc.chord)
        self._left_contour = False
        for letter in (*named, *POLAR):
            block.take(letter)

    def _arc(self, block: ProgramBlock, target: Floats) -> Arc:
        from dbbstation.nc.rs274.arcs import arc_of  # noqa: PLC0415 - as for `Cutter`

        if self._left_contour:
            raise block.fault("the move behind G40 is an arc", "leave it straight")
        arc = arc_of(
            block,
            self._state,
            target,
            clockwise=self._motion == CLOCKWISE,
            plane=self._plane,
            absolute=self._absolute_centres,
        )
        if len(self.path) + arc.chords > MOST_ROWS:
            raise too_long(block)
        return arc

    def _curve(self, block: ProgramBlock, named: list[str]) -> None:
        from dbbstation.nc.rs274.arcs import curve_of  # noqa: PLC0415 - the same

        code = block.codes[ModalGroup.SMOOTHING]
        other = block.words.keys() - set("XYIJPQ") or {*block.codes} & {ModalGroup.MOTION, ModalGroup.ONCE}
        if not named or any((other, self._plane, self._cutter, self._absolute_centres, self._left_contour)):
            what = f"{name('G', code.value)} is a curve in X and Y, without G41, G42, G90.1 and another motion"
            raise block.fault(what, CURVES, code)
        unknown = unplaced(self._state.pose)
        if unknown:
            raise unknown_place(block, unknown)
        self._begin_motion(code.value)
        poses = curve_of(block, self._state, self._target(block))
        length_mm = float(lengths(np.diff(poses[:, :3], axis=0, prepend=self._state.pose[None, :3])).sum())
        self._cut(block, poses, (length_mm, 0.0))
        self._motion = None
        for letter in named:
            del block.words[letter]

    def _go_beside(self, cutter: Cutter, block: ProgramBlock, target: Floats) -> None:
        from dbbstation.nc.rs274.cutter import NoRoomError, element_of, with_plane  # noqa: PLC0415 - as for `Cutter`

        arc = self._arc(block, target) if self._motion in ARCS else None
        if self._motion != RAPID:
            self._check_feed(block)
        self._begin_move(block, target)
        plane = PLANES[self._plane]
        begin, end = (complex(*pose[plane]) for pose in (self._state.pose, target))
        try:
            if self._beside is None:
                cutter.check_entry(begin, end)
            if begin == end and arc is None and self._beside is not None:
                self._piece(block, with_plane(target, plane, self._beside.place))
            else:
                element = element_of(begin, end, arc)
                self._along(cutter, element, arc, block, target)
        except NoRoomError:
            what = f"a tool with radius {cutter.radius_mm:g} mm has no room here beside the contour"
            remedy = "enter contours (G41, G42) by more than the radius, or take a smaller tool"
            raise block.fault(what, remedy) from None
        self._state.pose = target

    def _along(self, cutter: Cutter, element: Element, arc: Arc | None, block: ProgramBlock, target: Floats) -> None:
        from dbbstation.nc.rs274.arcs import Arc  # noqa: PLC0415 - the same
        from dbbstation.nc.rs274.cutter import Beside, with_plane  # noqa: PLC0415 - the same

        plane, last = PLANES[self._plane], self._beside
        if last is None:
            element = cutter.entered(element, element.begin) if arc else element
        else:
            place, around = cutter.corner(last.element, element)
            if place != last.place:
                self.path.bend(last.added, *last.bent(place), plane)
            if around:
                mid = cutter.beside(element, element.begin)
                there = with_plane(target, plane, mid)
                rise = 3 - int(plane.sum())
                there[rise] = self._state.pose[rise]
                corner = (element.begin.real, element.begin.imag)
                turn = Arc(self.path.pose, there, corner, clockwise=cutter.side > 0, plane=self._plane)
                self._piece(block, there, None if self._motion == RAPID else turn)
        start, there = self.path.pose, with_plane(target, plane, cutter.beside(element, element.end))
        if arc is not None:
            cutter.reaches(element)
            arc = replace(arc, start=start, end=there, centre_mm=(element.centre.real, element.centre.imag))
        self._beside = Beside(element, len(self.path), start, there, plane, arc)
        if last is not None:
            self._beside.check(element.swept_rad)
        self._piece(block, there, arc)

    def _piece(self, block: ProgramBlock, target: Floats, arc: Arc | None = None) -> None:
        line = block.place.line
        if self._motion == RAPID:
            self.path.rapid(target, line=line)
        elif arc is None:
            self.path.feed(target[None], *self._speed, line=line)
        else:
            self.path.feed(arc.poses(), *self._speed, line=line, arc=arc.chord)

    def _begin_motion(self, motion: float) -> None:
        if motion in CYCLES and self._motion not in CYCLES:
            self._cycle.begun_at, self._before_cycle = float(self._state.pose[2]), self._motion
        if motion != self._motion:
            self._cycle.numbers = {}
        self._motion, self._since_cycle = motion, False

    def _goes_nowhere(self, block: ProgramBlock, motion: float | None, once: float | None) -> bool:
        """Return whether a line without axes is a move: an arc with a centre, or for LinuxCNC a motion code alone."""
        if self._motion in ARCS and (motion is not None or any(each in block.words for each in CENTRES)):
            return True
        return motion in {RAPID, LINEAR} and not np.isnan(self._state.pose).any() and once not in TAKES_AXES

    def _cut(
        self,
        block: ProgramBlock,
        poses: Floats,
        length: tuple[float, float],
        *,
        in_machine: bool = False,
        arc: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        self._check_feed(block)
        self._begin_move(block, poses[-1])
        speed, unknown = self._speed, bits_of(np.isnan(poses[-1]))
        if self._per_move:  # G93: one over the minutes of the move
            speed = Feed(*(max(each * self._speed.deg_min, LEAST_F) for each in length))
        self.path.feed(poses, *speed, line=block.place.line, in_machine=in_machine, arc=arc, unknown=unknown)
        self._state.pose = poses[-1]

    def _begin_move(self, block: ProgramBlock, target: Floats) -> None:
        if not self._moved:
            if self._given and self._motion != RAPID:  # the begin of a cut is corrected as well
                self.path.rapid(self._state.pose, line=block.place.line)
            if not self._system_said:
                self._hold(IN_FORCE, self._state.offset_of(1))
            self._moved = True
        if self._upright and self._state.length_said and np.abs(target[3:5]).max() > 0.0:
            what = "A or B turns under G43.4, which would tilt the tool length"
            raise block.fault(what, "post the program for the tip, without G43.4")

    def _check_machine(self, machine: Word, block: ProgramBlock, named: list[str]) -> None:
        if self._motion not in {RAPID, LINEAR} or not named:
            raise block.fault("G53 is allowed only with G0 or G1, and with axes", "remove it", machine)
        if not self._absolute:
            raise block.fault("G53 is allowed only with absolute distances (G90)", "write G90 before it", machine)

    def _check_feed(self, block: ProgramBlock, column: int | None = None) -> None:
        if self._unsure_feed is not None:
            raise self._unsure_feed
        if self._speed.mm_min <= 0.0:
            raise block.fault(
                f"{name('G', self._motion or 0.0)} without a feed", "give F in this line or before", column
            )

    def _target(self, block: ProgramBlock, *, in_machine: bool = False, through: bool = False) -> Floats:
        """Return the pose at the end of a block in machine coordinates, shape (6,)."""
        target: list[float] = self._state.pose.tolist()  # six numbers are sooner done without arrays
        offset = (0.0,) * 6 if in_machine else self._state.offset
        for axis, letter in enumerate(AXES):
            word = block.words.get(letter)
            if word is not None:
                value = word.value * (self._state.unit_mm if axis < 3 else 1.0)  # noqa: PLR2004
                if not self._absolute and math.isnan(target[axis]) and value != 0.0:
                    raise unknown_place(block, [letter])
                target[axis] = value + offset[axis] if self._absolute else target[axis] + value
        if not block.words.keys().isdisjoint(POLAR):
            target[:2] = self._by_angle(block, target, offset)
        if self._motion != RAPID and not through:
            unknown = unplaced(target)
            if unknown:
                self._cut_somewhere(block, unknown)
        if any(abs(value) > far for value, far in zip(target, FARTHEST, strict=True)):
            what = f"this move leads beyond {FARTHEST_MM:g} mm or {FARTHEST_DEG:g} degrees"
            raise block.fault(what, "check the numbers, and whether G91 or G20 is in force")
        return np.array(target)

    def _cut_somewhere(self, block: ProgramBlock, unknown: list[str]) -> None:
        """Allow a straight move at feed although the program has not yet named all axes. It must name them later."""
        fault = unknown_place(block, unknown)
        left = any(AXES.index(letter) in self._away for letter in unknown)
        if left or self._motion != LINEAR or self._per_move or self._cutter is not None:
            raise fault
        self._unplaced = self._unplaced or (block.place, fault)

    def _by_angle(self, block: ProgramBlock, pose: list[float], offset: tuple[float, ...]) -> list[float]:
        """Return X and Y of polar coordinates about the origin, in machine coordinates [mm] [LinuxCNC, Polar Coordinates]."""
        radius_word, angle_word = (block.words.get(letter) for letter in POLAR)
        once = block.code(ModalGroup.ONCE)
        other = self._plane != 0 or ModalGroup.PLANE in block.codes or once in {*TAKES_AXES, MACHINE}
        if other or block.words.keys() & {"X", "Y"} or any(self._state.length[:2]):
            what = "polar coordinates (@, ^) go with moves in G17, without G53, X, Y and a tool length in these"
            raise block.fault(what, "write X and Y")
        x, y = (at - zero for at, zero in zip(pose[:2], offset, strict=False))
        radius, angle_deg = math.hypot(x, y), math.degrees(math.atan2(y, x))
        partly = not self._absolute or radius_word is None or angle_word is None
        if partly and math.isnan(radius):
            raise unknown_place(block, ["X", "Y"])
        if partly and radius < LEAST_MM and (radius_word is not None or not self._absolute):
            raise block.fault("polar coordinates (@, ^) from the origin need an angle", "write X and Y")
        if radius_word is not None:
            radius = radius_word.value * self._state.unit_mm + (0.0 if self._absolute else radius)
        if angle_word is not None:
            angle_deg = angle_word.value + (0.0 if self._absolute else angle_deg)
        angle = math.radians(angle_deg)
        return [radius * math.cos(angle) + offset[0], radius * math.sin(angle) + offset[1]]

    def _run_cycle(self, block: ProgramBlock, named: list[str]) -> None:
        from dbbstation.nc.rs274.cycles import cycle_steps, depths_of  # noqa: PLC0415 - the same

        column, code = block.first_column, self._motion or 0.0
        times = block.take("L")
        if self._plane != 0 or self._per_move or {"A", "B", "C"} & set(named):
            what = f"{name('G', code)} with {'another plane than G17' if self._plane else 'G93, or A, B, C'}"
            raise block.fault(what, "post cycles as single moves", column)
        if self._cutter is not None:
            raise block.fault("a cycle beside a contour (G41, G42)", "write G40 before it", column)
        depths = depths_of(self._cycle, code, block, self._state, column, absolute=self._absolute)
        self._check_feed(block, column)
        if code in TAPS:
            self._check_tap(block, code)
        corner, self.path.corner_mm = self.path.corner_mm, 0.0  # LinuxCNC follows the exact path there
        for _ in range(1 if times is None else int(times.value)):
            if self._cycle.begun_at < depths.clear:
                self._go(block, depth=depths.clear)
            self._rapid(block, self._target_of_cycle(block), [0, 1])
            self._go(block, depth=depths.clear)
            for step in cycle_steps(code, depths, self._turning):
                self._cycle_step(block, step.what, step.depth)
        self.path.corner_mm = corner
        for letter in (*named, *POLAR):
            block.take(letter)

    def _target_of_cycle(self, block: ProgramBlock) -> Floats:
        motion, self._motion = self._motion, RAPID
        target = self._target(block)
        self._motion = motion
        return target

    def _cycle_step(self, block: ProgramBlock, what: str, depth: float) -> None:
        line = block.place.line
        if what == "dwell":
            before_s = self._cycle.dwell_s if self._motion in TAPS else 0.0
            self.path.dwell(self._cycle.numbers.get("P", before_s), line=line)
        elif what in {"rapid", "feed"}:
            self._go(block, depth=depth, feed=what == "feed")
        elif what not in {"M48", "M49"} or self._in_force[ModalGroup.OVERRIDE] == "M48":
            self.path.say(RowKind.FUNCTION, what, line=line)

    def _check_tap(self, block: ProgramBlock, code: float) -> None:
        if self._turning != TAPS[code]:
            what = f"{name('G', code)} while the spindle does not turn by {TAPS[code]}"
            raise block.fault(what, f"write {TAPS[code]} before it")
        self.path.notes += (FLOATING,) if FLOATING not in self.path.notes else ()

    def _go(self, block: ProgramBlock, *, depth: float, feed: bool = False) -> None:
        target = self._state.pose.copy()
        target[2] = depth
        if feed:
            self._cut(block, target[None], (0.0, 0.0))
        else:
            self._rapid(block, target, [2])


def named_axes(block: ProgramBlock) -> list[str]:
    """Return the axes that a block names; polar coordinates name X and Y."""
    polar = "" if block.words.keys().isdisjoint(POLAR) else "XY"
    return [letter for letter in AXES if letter in block.words or letter in polar]


def too_long(block: ProgramBlock) -> BadLine:
    """Return the fault of a program with too many moves."""
    what = f"up to here the program has more than {MOST_ROWS} moves, arcs as chords"
    return block.fault(what, "check the turns (P) of its arcs, or compensate it in parts", 0)
