"""From blocks to a toolpath through the modal state of a control."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.nc.dialect import plain
from dbbstation.nc.rs274.arcs import Arc, centre_by_radius
from dbbstation.nc.rs274.blocks import ProgramBlock, blocks
from dbbstation.nc.rs274.codes import ModalGroup, name
from dbbstation.nc.rs274.tokens import BadLine
from dbbstation.nc.toolpath import MACHINE_SYSTEM, SYSTEMS, Ending, RowKind, Toolpath, ToolpathBuilder
from dbbstation.nc.words import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.rs274.tokens import Word

AXES = "XYZABC"
MM_PER_INCH = 25.4
MESSAGE = "MSG, "
"""What a message begins with that stands before a stop, as people write it."""

MOST_ROWS = 1_000_000
"""Moves and stops that a program may have once its arcs are chords: 260 full turns of 150 mm, or a path of 50 m in steps
of 0.05 mm. All of it is inverted at once, for the sake of sources with a history; it takes some gigabytes then."""

FARTHEST_MM, FARTHEST_DEG = 100_000.0, 36_000.0
"""No increment may lead farther than this, as no number may be larger."""

RAPID, LINEAR, CLOCKWISE, COUNTER_CLOCKWISE = 0.0, 1.0, 2.0, 3.0
DWELL, MACHINE = 4.0, 53.0
PAUSE, OPTIONAL_STOP = 0.0, 1.0


def read_program(text: str, file: str, *, start: NDArray[np.float64] | None = None) -> Toolpath:
    """Return what a program commands.

    Args:
        start: pose before the program, shape (6,) [mm, deg]; None if unknown.

    Raises:
        InputError: faults with line and column; all unreadable words at once, or the first block that makes no sense.
    """
    faults: list[Problem] = []
    senseless: BadLine | None = None
    interpreter = _Interpreter(ToolpathBuilder(file, start), start)
    interpreter.path.ending = Ending.TEXT  # unless a block says otherwise
    interpreter.path.units_said = False
    for block in blocks(text, file, faults):
        if faults or senseless is not None:
            continue  # the other lines are looked at for what cannot be read
        try:
            interpreter.run(block)
        except BadLine as fault:
            senseless = fault
    if faults:
        raise InputError(faults)
    if senseless is not None:
        raise InputError([senseless.problem])
    path = interpreter.path.built()
    if not path.is_move.any():
        raise InputError([Problem(file, 0, 0, "this program moves nothing", "check that it is the file you mean")])
    return path


class Feed(NamedTuple):
    """What F stands for: the tool tip, or the angles if only they move."""

    mm_min: float
    deg_min: float


class _Interpreter:
    """Modal state; begins as LinuxCNC does, in millimetres."""

    def __init__(self, path: ToolpathBuilder, start: NDArray[np.float64] | None) -> None:
        self.path = path
        self._pose = np.full(6, np.nan) if start is None else np.array(start, dtype=np.float64)
        self._motion: float | None = None
        self._speed = Feed(0.0, 0.0)
        self._unit_mm = 1.0
        self._absolute = True
        self._absolute_centres = False

    def run(self, block: ProgramBlock) -> None:
        """Execute one block in the order of [RS274/NGC 3.8]."""
        if "N" in block.words:
            numbered = int(block.words["N"].value)
            self.path.numbers = (*self.path.numbers[:1], numbered)
        self._said(block)
        self._units(block)
        self._feed(block)
        self._functions(block)
        self._shared_words(block)
        if block.code(ModalGroup.ONCE) == DWELL:
            self.path.dwell(self._dwell_s(block), line=block.place.line)
        self._modes(block)
        self._move(block)
        self._stop(block)
        self._nothing_left(block)
        if len(self.path) > MOST_ROWS:
            raise _too_long(block)

    def _said(self, block: ProgramBlock) -> None:
        if block.guard is not None:
            if self._motion is not None:
                what = "a guard against offsets after the first move"
                raise block.place.fault(1, what, "compensate programs one by one")
            self.path.guard = block.guard
        for comment in block.comments:
            if comment:
                self.path.say(RowKind.COMMENT, comment, line=block.place.line)
        if block.message:
            self.path.say(RowKind.MESSAGE, block.message, line=block.place.line)

    def _units(self, block: ProgramBlock) -> None:
        units = block.code(ModalGroup.UNITS)
        if units is None:
            return
        self.path.units_said = True
        unit_mm = MM_PER_INCH if units == 20.0 else 1.0  # noqa: PLR2004
        if unit_mm != self._unit_mm and "F" in block.words:
            # LinuxCNC sets the feed before it changes units, so F would still count in the old ones.
            column, code = block.words["F"].column, name("G", units)
            what = f"F in the line of {code} counts in the units before it on some controls and after it on others"
            raise block.place.fault(column, what, f"write {code} in a line before")
        self._unit_mm = unit_mm

    def _feed(self, block: ProgramBlock) -> None:
        if ModalGroup.FEED_MODE in block.codes:
            # LinuxCNC forgets F at every G94, even where it was in force already.
            self._speed = Feed(0.0, 0.0)
        word = block.words.pop("F", None)
        if word is not None:
            if word.value < 0.0:
                raise block.place.fault(word.column, f"the feed is negative (F{word.value:g})", "give a positive feed")
            # Degrees are degrees in G20 as well: only the speed of the tool tip counts in inches.
            self._speed = Feed(word.value * self._unit_mm, word.value)

    def _functions(self, block: ProgramBlock) -> None:
        speed = block.words.get("S")
        if speed is not None and speed.value < 0.0:
            raise block.place.fault(speed.column, f"the spindle's speed is negative (S{speed.value:g})", "use M3 or M4")
        said = [block.words.pop("S", None), block.codes.get(ModalGroup.SPINDLE), block.codes.get(ModalGroup.COOLANT)]
        text = " ".join(f"{word.letter}{number(word.value)}" for word in said if word is not None)
        if text:
            self.path.say(RowKind.FUNCTION, text, line=block.place.line)

    def _shared_words(self, block: ProgramBlock) -> None:
        """Refuse codes in one line that share a word or undo each other."""
        if not block.codes:
            return
        users = [self._in_line(block, ModalGroup.ONCE, {DWELL}), self._in_line(block, ModalGroup.PATH, {64.0})]
        users += [self._in_line(block, ModalGroup.MOTION, {CLOCKWISE, COUNTER_CLOCKWISE}) or self._modal_arc(block)]
        both = [code for code in users if code]
        if len(both) > 1 and ("P" in block.words or both[0] == name("G", DWELL)):
            column = block.words["P"].column if "P" in block.words else 1
            what = f"{' and '.join(both)} both take P"
            raise block.place.fault(column, what, "write them in separate lines")
        if ModalGroup.CYCLE in block.codes and ModalGroup.MOTION in block.codes:
            column = block.codes[ModalGroup.CYCLE].column
            raise block.place.fault(column, "G80 ends the motion that the same line begins", "remove one of them")

    @staticmethod
    def _in_line(block: ProgramBlock, group: ModalGroup, values: set[float]) -> str:
        value = block.code(group)
        return name("G", value) if value in values and value is not None else ""

    def _modal_arc(self, block: ProgramBlock) -> str:
        """Return the arc of a line without its own code; empty if it makes none."""
        is_arc = self._motion in {CLOCKWISE, COUNTER_CLOCKWISE} and ModalGroup.MOTION not in block.codes
        return name("G", self._motion or 0.0) if is_arc and block.words.keys() & set(AXES + "IJ") else ""

    def _dwell_s(self, block: ProgramBlock) -> float:
        word = block.words.pop("P", None)
        if word is None or word.value < 0.0:
            column = block.codes[ModalGroup.ONCE].column
            raise block.place.fault(column, "G4 needs the seconds to wait", "write G4 P0.5 for half a second")
        return word.value

    def _modes(self, block: ProgramBlock) -> None:
        if not block.codes:
            return
        distance, centres = block.code(ModalGroup.DISTANCE), block.code(ModalGroup.ARC_DISTANCE)
        if distance is not None:
            self._absolute = distance == 90.0  # noqa: PLR2004
            self.path.increments = not self._absolute
        if centres is not None:
            self._absolute_centres = centres == 90.1  # noqa: PLR2004
        if ModalGroup.CYCLE in block.codes:
            self._motion = None
        if ModalGroup.OFFSET in block.codes:
            system = name("G", block.codes[ModalGroup.OFFSET].value)
            self.path.system = SYSTEMS.index(system) + 1
            self.path.say(RowKind.SYSTEM, system, line=block.place.line)
        if ModalGroup.PATH in block.codes:
            self._path_control(block)

    def _path_control(self, block: ProgramBlock) -> None:
        word = block.codes[ModalGroup.PATH]
        corner = 0.0
        if word.value == 64.0:  # noqa: PLR2004
            allowed, _ = block.words.pop("P", None), block.words.pop("Q", None)
            # LinuxCNC takes P0 for no bound, as if P were not there.
            corner = allowed.value * self._unit_mm if allowed is not None and allowed.value > 0.0 else math.inf
        self.path.corner_mm = corner

    def _move(self, block: ProgramBlock) -> None:
        motion = block.code(ModalGroup.MOTION)
        if motion is not None:
            self._motion = motion
        named = [letter for letter in AXES if letter in block.words]
        is_arc = self._motion in {CLOCKWISE, COUNTER_CLOCKWISE}
        is_turn = is_arc and (motion is not None or "I" in block.words or "J" in block.words)
        machine = block.codes[ModalGroup.ONCE] if block.code(ModalGroup.ONCE) == MACHINE else None
        if machine is not None:
            self._check_machine(machine, block, named)
        # LinuxCNC makes a move to where it stands of a motion code alone.
        stays = not named and motion in {RAPID, LINEAR} and not np.isnan(self._pose).any()
        if motion == LINEAR:
            self._check_feed(block, _first_column(block))
        if not named and not is_turn and not stays:
            return
        if self._motion is None:
            word = block.words[named[0]]
            raise block.place.fault(word.column, f"{word.letter} without a motion code", "write G0 or G1 before it")
        target = self._target(block)
        axes, system = [AXES.index(letter) for letter in named], None if machine is None else MACHINE_SYSTEM
        if self._motion == RAPID:
            self.path.rapid(target, line=block.place.line, named=axes, system=system)
        else:
            self._check_feed(block, _first_column(block))
            speed, line = self._speed, block.place.line
            if self._motion == LINEAR:
                self.path.feed(target[None], speed.mm_min, speed.deg_min, line=line, named=axes, system=system)
            else:
                arc = self._chords(block, target)
                poses, chord = arc.poses(), arc.chord
                self.path.feed(poses, speed.mm_min, speed.deg_min, line=line, named=axes, system=system, arc=chord)
        for letter in named:
            del block.words[letter]
        self._pose = target

    def _check_machine(self, machine: Word, block: ProgramBlock, named: list[str]) -> None:
        if self._motion not in {RAPID, LINEAR} or not named:
            raise block.place.fault(machine.column, "G53 goes with G0 and G1 only, and with axes", "remove it")
        if not self._absolute:
            raise block.place.fault(
                machine.column, "G53 goes with absolute distances (G90) only", "write G90 before it"
            )

    def _check_feed(self, block: ProgramBlock, column: int) -> None:
        if self._speed.mm_min <= 0.0:
            raise block.place.fault(
                column, f"{name('G', self._motion or 0.0)} without a feed", "give F before or in it"
            )

    def _target(self, block: ProgramBlock) -> NDArray[np.float64]:
        """Return the pose that a block leads to, shape (6,)."""
        target: list[float] = self._pose.tolist()  # six numbers are sooner done without arrays
        for axis, letter in enumerate(AXES):
            word = block.words.get(letter)
            if word is not None:
                value = word.value * (self._unit_mm if axis < 3 else 1.0)  # noqa: PLR2004
                target[axis] = value if self._absolute else target[axis] + value
        unknown = [letter for letter, value in zip(AXES, target, strict=True) if math.isnan(value)]
        if unknown:
            what = f"nobody knows where {', '.join(unknown)} stand{'s' if len(unknown) == 1 else ''} before this move"
            remedy = "name all six axes in the first move, absolutely (G90), or say where the machine stands"
            raise block.place.fault(_first_column(block), what, remedy)
        if max(map(abs, target[:3])) > FARTHEST_MM or max(map(abs, target[3:])) > FARTHEST_DEG:
            what = f"this move leads beyond {FARTHEST_MM:g} mm or {FARTHEST_DEG:g} degrees"
            raise block.place.fault(_first_column(block), what, "check its numbers, and G91 and G20 before it")
        return np.array(target)

    def _chords(self, block: ProgramBlock, target: NDArray[np.float64]) -> Arc:
        arc = self._arc(block, target)
        if len(self.path) + arc.chords > MOST_ROWS:
            raise _too_long(block)
        return arc

    def _arc(self, block: ProgramBlock, target: NDArray[np.float64]) -> Arc:
        clockwise = self._motion == CLOCKWISE
        column = _first_column(block)
        radius = block.words.pop("R", None)
        offsets = [block.words.pop(letter, None) for letter in "IJ"]
        turns = self._turns(block)
        if radius is not None:
            if any(offsets):
                raise block.place.fault(radius.column, "an arc has R, or I and J, not both", "remove one")
            by_radius = centre_by_radius(self._pose, target, radius.value * self._unit_mm, clockwise=clockwise)
            if by_radius is None:
                what = f"no arc of R{radius.value:g} leads from the point before to this one"
                raise block.place.fault(radius.column, what, "check R, or write a full turn with I and J")
            return Arc(self._pose, target, by_radius, clockwise=clockwise, turns=turns)
        if not any(offsets):
            raise block.place.fault(column, f"{name('G', self._motion or 0.0)} needs I and J, or R", "give the centre")
        centre = np.array([0.0 if word is None else word.value * self._unit_mm for word in offsets])
        if not self._absolute_centres:
            centre += self._pose[:2]
        elif not all(offsets):
            raise block.place.fault(column, "G90.1 needs both I and J", "give both, or G91.1")
        arc = Arc(self._pose, target, (float(centre[0]), float(centre[1])), clockwise=clockwise, turns=turns)
        if not arc.is_round():
            first, last = arc.radii_mm()
            what = f"start and end of the arc lie {first:.4f} and {last:.4f} mm from its centre"
            raise block.place.fault(column, what, "check end point and centre")
        return arc

    def _turns(self, block: ProgramBlock) -> int:
        word = block.words.pop("P", None)
        if word is None:
            return 1
        if word.value < 1.0 or word.value != int(word.value):
            raise block.place.fault(word.column, f"P{word.value:g} is no number of turns", "give a whole number from 1")
        return int(word.value)

    def _stop(self, block: ProgramBlock) -> None:
        stop = block.code(ModalGroup.STOP)
        if stop == PAUSE:
            self.path.say(RowKind.PAUSE, self._said_before(), line=block.place.line)
        elif stop == OPTIONAL_STOP:
            self.path.say(RowKind.OPTIONAL_STOP, "", line=block.place.line)
        elif stop is not None:
            self.path.ending = Ending(name("M", stop))

    def _said_before(self) -> str:
        """Return the message written before a stop, or the stop's own."""
        text = self.path.last_text.removeprefix(MESSAGE)
        is_own = (
            self.path.last_kind == RowKind.MESSAGE and self.path.last_text == MESSAGE + text and text == plain(text)
        )
        return self.path.taken_back().removeprefix(MESSAGE) if is_own else ""

    def _nothing_left(self, block: ProgramBlock) -> None:
        """Refuse words that the block does not use."""
        for letter, word in block.words.items():
            if letter != "N":
                what = f"nothing in this line uses {letter}{word.value:g}"
                raise block.place.fault(word.column, what, "remove it, or give the code that it belongs to")


def _first_column(block: ProgramBlock) -> int:
    """Return the column of the first word that is neither code nor line number, else of the motion code."""
    words = [word.column for letter, word in block.words.items() if letter != "N"]
    return min(words) if words else block.codes[ModalGroup.MOTION].column


def _too_long(block: ProgramBlock) -> BadLine:
    what = f"up to here the program has more than {MOST_ROWS} moves, arcs as chords"
    return block.place.fault(0, what, "check the turns (P) of its arcs, or compensate it in parts")
