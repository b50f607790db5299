"""From blocks to a toolpath through the modal state of a control."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.nc.dialect import plain
from dbbstation.nc.rs274.arc_words import CENTRES, arc_of
from dbbstation.nc.rs274.blocks import ProgramBlock, block_of
from dbbstation.nc.rs274.codes import CYCLES, ModalGroup, name
from dbbstation.nc.rs274.cycles import ModalCycle, cycle_steps
from dbbstation.nc.rs274.flow import Flow
from dbbstation.nc.rs274.plain import LINES, going_on, plain_lines
from dbbstation.nc.rs274.state import AXES, ControlState, unknown_place
from dbbstation.nc.rs274.tokens import BadLine
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.toolpath import (
    ALL_AXES,
    EXACT_STOP_MM,
    IN_FORCE,
    LEAST_MM,
    MESSAGE,
    Ending,
    RowKind,
    Toolpath,
    ToolpathBuilder,
    bits_of,
)
from dbbstation.nc.words import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.rs274.tokens import Word

MM_PER_INCH = 25.4

MOST_ROWS = 1_000_000
"""Moves and stops that a program may have once its arcs are chords: 260 full turns of 150 mm, or a path of 50 m in steps
of 0.05 mm. All of it is inverted at once, for the sake of sources with a history; it takes some gigabytes then."""

MOST_FAULTS = 20
"""A program of another language has a fault in every line; the first ones tell."""

FARTHEST_MM, FARTHEST_DEG = 100_000.0, 36_000.0
"""No increment may lead farther than this, as no number may be larger."""

RAPID, LINEAR, CLOCKWISE, COUNTER_CLOCKWISE = 0.0, 1.0, 2.0, 3.0
ARCS = frozenset({CLOCKWISE, COUNTER_CLOCKWISE})
DWELL, MACHINE = 4.0, 53.0
TAKES_AXES = frozenset({10.0, 28.0, 30.0, 52.0, 92.0})
"""Codes of one line that take its axis words for themselves."""

PAUSE, OPTIONAL_STOP, SET_TOOL = 0.0, 1.0, 61.0
POLAR = "@^"
"""Letters of a radius and an angle in degrees, in place of X and Y."""

TURNS = 0b111000
"""A, B and C, which no tool changer is taken to move where they were declared."""

ENDS = frozenset({2.0, 30.0})


def read_program(
    text: str, file: str, *, start: NDArray[np.float64] | None = None, setup: ControlSetup | None = None
) -> Toolpath:
    """Return what a program commands.

    Args:
        start: pose before the program, shape (6,) [mm, deg], NaN for unknown axes; None: all unknown.
        setup: offsets and tool lengths of the control; None: all zero.

    Raises:
        InputError: faults with line and column; all unreadable words at once, or the first block that makes no sense.
    """
    text = text.removeprefix("\ufeff")
    if "\r" in text and "\n" not in text:
        text = text.replace("\r", "\n")
    interpreter = _Interpreter(text, file, start, setup or ControlSetup())
    try:
        interpreter.run_all()
    except BadLine as fault:
        raise InputError(_unreadable(interpreter.flow) or [fault.problem]) from None
    path = interpreter.path.built()
    if not path.is_move.any():
        raise InputError([Problem(file, 0, 0, "this program moves nothing", "check that it is the file you mean")])
    return path


def _unreadable(flow: Flow) -> list[Problem]:
    faults: list[Problem] = []
    for line, place in flow.all_lines():
        try:
            block = block_of(line, place)
        except BadLine as fault:
            faults.append(fault.problem)
        else:
            if block.code(ModalGroup.STOP) in ENDS:
                break
        if len(faults) >= MOST_FAULTS:
            break
    return faults


class Feed(NamedTuple):
    """Meaning of F: speed of the tool tip, or of the angles if only they move."""

    mm_min: float
    deg_min: float


class _Interpreter:
    """Modal state; begins as LinuxCNC does, in millimetres."""

    def __init__(self, text: str, file: str, start: NDArray[np.float64] | None, setup: ControlSetup) -> None:
        self.path = ToolpathBuilder(file, start)
        self.path.ending = Ending.TEXT  # unless a block says otherwise
        self.path.units_said = False
        pose = np.full(6, np.nan) if start is None else np.array(start, dtype=np.float64)
        self._state = ControlState(setup, pose)
        self.flow = Flow(text, file, self._state.parameter)
        self._given = not np.isnan(pose).any()
        self._fixed = bits_of(~np.isnan(pose)) & TURNS
        self._motion: float | None = None
        self._speed = Feed(0.0, 0.0)
        self._per_move = False
        self._absolute = True
        self._absolute_centres = False
        self._plane = 0
        self._cycle = ModalCycle()
        self._turning, self._stopped = "", 0
        self._upright = self._moved = False
        self._system_said = False
        self.path.holds = {}
        self.path.count_from(self._state.offset)
        if any(self._state.g92):
            self._hold("G92", self._state.g92)

    def run_all(self) -> None:
        """Run all blocks to the program's end.

        Raises:
            BadLine: the first one that makes no sense.
        """
        for line, place in self.flow.lines():
            if self._ran_lines(place.line):
                continue
            block = block_of(line, place, self.flow.value_of)
            for setting in block.settings:
                self._set(block, setting.parameter, setting.value, setting.column)
            self.run(block)
            if block.code(ModalGroup.STOP) in ENDS:
                self.flow.ended()
                break
        else:
            # A spindle that stops behind the last cut ends programs that have no other end, as for GRBL.
            if not (self.flow.closed or (not self.flow.percent and 0 < self.path.fed <= self._stopped)):
                raise BadLine(self.flow.cut_short())
        unknown = [letter for letter, value in zip(AXES, self._state.pose, strict=True) if math.isnan(value)]
        if unknown and self._moved:
            raise unknown_place(block, unknown, "in this program")

    def _ran_lines(self, first: int) -> bool:
        """Run lines of axes together, this one and those that follow it; return False if it is to run by itself."""
        ready = self._moved and self._absolute and self._motion in {RAPID, LINEAR}
        if not ready or self._per_move or self._upright or self.path.unknown:
            return False
        text = self.flow.lines_like(LINES)
        if not text:
            return False
        lines, unit_mm = plain_lines(text), self._state.unit_mm
        modal = np.column_stack([lines.motion, lines.feed])
        motion, feed = going_on(modal, np.array([self._motion, self._speed.deg_min])).T
        scale = np.array([unit_mm] * 3 + [1.0] * 3)
        poses = going_on(lines.axes * scale + np.array(self._state.offset), self._state.pose)
        bad = ((motion == LINEAR) & (feed <= 0.0)) | (np.abs(poses).max(axis=1) >= FARTHEST_DEG)
        bad[max(MOST_ROWS - len(self.path), 0) :] = True
        end = int(np.argmax(bad)) if bad.any() else len(bad)
        if end == 0:
            return False
        # An F from before counts in the units that were in force there.
        old = np.logical_and.accumulate(np.isnan(lines.feed))
        state = np.column_stack([motion, feed, old])[:end]
        new = np.flatnonzero((state[1:] != state[:-1]).any(axis=1)) + 1
        for begin, until in pairwise([0, *new.tolist(), end]):
            self._begin_motion(float(motion[begin]))
            if not old[begin]:
                self._speed = Feed(float(feed[begin]) * unit_mm, float(feed[begin]))
            speed = None if self._motion == RAPID else self._speed
            self.path.lines(poses[begin:until], speed, line=first + begin)
        self._state.pose = poses[end - 1].copy()
        numbers = (*self.path.numbers, *lines.numbers)
        self.path.numbers = (*numbers[:1], *numbers[1:][-1:])
        self.flow.skip(end - 1)
        return True

    def run(self, block: ProgramBlock) -> None:
        """Execute one block in the order of [RS274/NGC 3.8]."""
        if "N" in block.words:
            self.path.numbers = (*self.path.numbers[:1], int(block.words.pop("N").value))
        if block.comments or block.message:
            self._said(block)
        if block.codes or self._per_move or len(block.words) > _moved(block):
            self._units(block)
            self._feed(block)
            self._functions(block)
            self._shared_words(block)
            if block.code(ModalGroup.ONCE) == DWELL:
                self.path.dwell(self._dwell_s(block), line=block.place.line)
            self._modes(block)
            self._tool_length(block)
            self._offsets(block)
        self._move(block)
        if block.codes:
            self._stop(block)
        self._nothing_left(block)
        if len(self.path) > MOST_ROWS:
            raise _too_long(block)

    def _set(self, block: ProgramBlock, which: int | str, value: float, column: int) -> None:
        if (isinstance(which, int) and which > LAST_OWN) or (
            isinstance(which, str) and self._state.parameter(which) is not None
        ):
            what = f"#{which if isinstance(which, int) else f'<{which}>'} is the control's own"
            raise block.place.fault(column, what, "set offsets with G10 L2, and lengths with --tool-length")
        self.flow.set(which, value)

    def _said(self, block: ProgramBlock) -> None:
        for comment in block.comments:
            if comment:
                self.path.say(RowKind.COMMENT, comment, line=block.place.line)
        if block.message:
            self.path.say(RowKind.MESSAGE, self._with_values(block.message), line=block.place.line)

    def _with_values(self, message: str) -> str:
        """Return a message with the values of its parameters."""
        if not _SHOWS_VALUES.match(message):
            return message

        def value(match: re.Match[str]) -> str:
            known = self.flow.value_of(int(match[1]) if match[1] else match[2].lower())
            return match[0] if known is None else f"{known:f}"

        return _SHOWN.sub(value, message)

    def _units(self, block: ProgramBlock) -> None:
        units = block.code(ModalGroup.UNITS)
        if units is None:
            return
        self.path.units_said = True
        unit_mm = MM_PER_INCH if units == 20.0 else 1.0  # noqa: PLR2004
        if unit_mm != self._state.unit_mm and "F" in block.words:
            # LinuxCNC sets the feed before it changes units, so F would still count in the old ones.
            column, code = block.words["F"].column, name("G", units)
            what = f"F in the line of {code} counts in the units before it on some controls and after it on others"
            raise block.place.fault(column, what, f"write {code} in a line before")
        self._state.unit_mm = unit_mm

    def _feed(self, block: ProgramBlock) -> None:
        if ModalGroup.FEED_MODE in block.codes:
            # LinuxCNC forgets F at every G94, even where it was in force already.
            self._per_move = block.code(ModalGroup.FEED_MODE) == 93.0  # noqa: PLR2004
            self._speed = Feed(0.0, 0.0)
        elif self._per_move:
            self._speed = Feed(0.0, 0.0)  # each move has its own
        word = block.words.pop("F", None)
        if word is not None:
            if word.value < 0.0:
                raise block.place.fault(word.column, f"the feed is negative (F{word.value:g})", "give a positive feed")
            # Degrees are degrees in G20 as well: only the speed of the tool tip counts in inches.
            self._speed = Feed(word.value * self._state.unit_mm, word.value)

    def _functions(self, block: ProgramBlock) -> None:
        speed, tool = block.words.get("S"), block.words.get("T")
        if speed is not None and speed.value < 0.0:
            raise block.place.fault(speed.column, f"the spindle's speed is negative (S{speed.value:g})", "use M3 or M4")
        if tool is not None and (tool.value < 0.0 or tool.value != int(tool.value)):
            raise block.place.fault(tool.column, f"T{tool.value:g} is no tool", "give a whole number")
        change, number_set = block.codes.get(ModalGroup.TOOL), None
        if change is not None and change.value == SET_TOOL:
            number_set = block.words.pop("Q", None)
            if number_set is None or number_set.value < 0.0 or number_set.value != int(number_set.value):
                raise block.place.fault(change.column, "M61 needs Q", "give the number of the tool")
        said = [block.words.pop("T", None), change, number_set]
        said += [block.codes.get(ModalGroup.SPEED), block.words.pop("S", None)]
        said += [block.codes.get(group) for group in (ModalGroup.SPINDLE, ModalGroup.COOLANT, ModalGroup.OVERRIDE)]
        text = " ".join(f"{word.letter}{number(word.value)}" for word in said if word is not None)
        if text:
            self.path.say(RowKind.FUNCTION, text, line=block.place.line)
        if ModalGroup.SPINDLE in block.codes:
            turning = name("M", block.codes[ModalGroup.SPINDLE].value)
            self._stopped = len(self.path) if self._turning and turning == "M5" else self._stopped
            self._turning = "" if turning == "M5" else turning
        if tool is not None:
            self._state.tool_selected = int(tool.value)
        if number_set is not None:
            self._state.tool = int(number_set.value)
        elif change is not None:
            self._state.tool = self._state.tool_selected
            self._turning = ""
            # A tool changer may move the machine: what no line names again before the next cut is not to be named either.
            self.path.unknown |= ALL_AXES & ~self._fixed

    def _shared_words(self, block: ProgramBlock) -> None:
        """Refuse codes in one line that share a word or cancel each other."""
        if not block.codes:
            return
        users = [self._in_line(block, ModalGroup.ONCE, {DWELL, 10.0}), self._in_line(block, ModalGroup.PATH, {64.0})]
        users += [self._in_line(block, ModalGroup.MOTION, ARCS) or self._modal_arc(block)]
        both = [code for code in users if code]
        if len(both) > 1 and ("P" in block.words or both[0] == name("G", DWELL)):
            column = block.words["P"].column if "P" in block.words else 1
            what = f"{' and '.join(both)} both take P"
            raise block.place.fault(column, what, "write them in separate lines")
        once = block.code(ModalGroup.ONCE)
        if once in TAKES_AXES and block.code(ModalGroup.MOTION) not in {None, RAPID, LINEAR}:
            column = block.codes[ModalGroup.ONCE].column
            what = f"{name('G', once or 0.0)} and {name('G', block.codes[ModalGroup.MOTION].value)} both take axes"
            raise block.place.fault(column, what, "write them in separate lines")

    @staticmethod
    def _in_line(block: ProgramBlock, group: ModalGroup, values: set[float] | frozenset[float]) -> str:
        value = block.code(group)
        return name("G", value) if value in values and value is not None else ""

    def _modal_arc(self, block: ProgramBlock) -> str:
        """Return the arc of a line without its own code; empty if it makes none."""
        is_arc = self._motion in ARCS and ModalGroup.MOTION not in block.codes
        return name("G", self._motion or 0.0) if is_arc and block.words.keys() & set(AXES + CENTRES + POLAR) else ""

    def _dwell_s(self, block: ProgramBlock) -> float:
        word = block.words.pop("P", None)
        if word is None or word.value < 0.0:
            column = block.codes[ModalGroup.ONCE].column
            raise block.place.fault(column, "G4 needs the seconds to wait", "write G4 P0.5 for half a second")
        return word.value

    def _modes(self, block: ProgramBlock) -> None:
        plane, distance = block.code(ModalGroup.PLANE), block.code(ModalGroup.DISTANCE)
        centres, back = block.code(ModalGroup.ARC_DISTANCE), block.code(ModalGroup.RETRACT)
        self._plane = self._plane if plane is None else int(plane) - 17
        self._absolute = self._absolute if distance is None else distance == 90.0  # noqa: PLR2004
        self._absolute_centres = self._absolute_centres if centres is None else centres == 90.1  # noqa: PLR2004
        self._cycle.to_clear = self._cycle.to_clear if back is None else back == 99.0  # noqa: PLR2004
        if ModalGroup.CYCLE_END in block.codes:
            self._motion, self._cycle.numbers = None, {}
        if ModalGroup.PATH in block.codes:
            self._path_control(block)

    def _path_control(self, block: ProgramBlock) -> None:
        word = block.codes[ModalGroup.PATH]
        corner = 0.0 if word.value == 61.0 else EXACT_STOP_MM  # noqa: PLR2004
        if word.value == 64.0:  # noqa: PLR2004
            allowed, _ = block.words.pop("P", None), block.words.pop("Q", None)
            # LinuxCNC takes P0 for no bound, as if P were not there.
            corner = allowed.value * self._state.unit_mm if allowed is not None and allowed.value > 0.0 else math.inf
        self.path.corner_mm = corner

    def _tool_length(self, block: ProgramBlock) -> None:
        word = block.codes.get(ModalGroup.TOOL_LENGTH)
        if word is None:
            return
        if word.value == 49.0:  # noqa: PLR2004
            said = self._state.length_said
            self._state.use_length(None, block, word)
            if said:
                self._system("G49", block)
            return
        if word.value != 43.0:  # noqa: PLR2004 - G43.4, along the tool
            tilt = self._state.pose[3:5]
            if np.isnan(tilt).any() or np.abs(tilt).max() > 0.0:
                what = "G43.4 while A or B is not zero"
                raise block.place.fault(word.column, what, "post the program for the tip, without G43.4")
            self._upright = True  # A and B must stay so: G43.4 would tilt the tool length
        tool = block.words.pop("H", None)
        which = self._state.use_length(tool, block, word)
        self._hold(f"H{which}", self._state.length)
        self._system(f"G43 H{which}", block)

    def _offsets(self, block: ProgramBlock) -> None:
        if ModalGroup.OFFSET in block.codes:
            system = name("G", block.codes[ModalGroup.OFFSET].value)
            self._state.use_system(system, block)
            self._system_said = True
            self._hold(system, self._state.offset_of(self._state.system))
            self._system(system, block)
        code = block.code(ModalGroup.ONCE)
        if code in {52.0, 92.0, 92.1, 92.2, 92.3}:
            self._hold("G92", self._state.g92)
            self._state.shift(code or 0.0, block)
            self.path.count_from(self._state.offset)
        elif code == 10.0:  # noqa: PLR2004
            told, system, before = self._state.set_system(block)
            self._hold(system, before)
            self._system(told, block)
        elif code in {28.0, 30.0}:
            self._to_reference(block)

    def _system(self, text: str, block: ProgramBlock) -> None:
        self.path.say(RowKind.SYSTEM, text, line=block.place.line)
        self.path.count_from(self._state.offset)

    def _hold(self, what: str, values: tuple[float, ...]) -> None:
        held = {} if self.path.holds is None else self.path.holds
        held.setdefault(what, values)
        self.path.holds = held
        self.path.count_from(self._state.offset)

    def _to_reference(self, block: ProgramBlock) -> None:
        word = block.codes[ModalGroup.ONCE]
        code, named = name("G", word.value), [letter for letter in AXES if letter in block.words]
        there = self._state.setup.place(code)
        if there is None:
            what = f"where {code} leads is not known"
            remedy = f"give its place with --offset {code}=X,Y,Z, or LinuxCNC's parameter file with --parameters"
            raise block.place.fault(word.column, what, remedy)
        axes = [AXES.index(letter) for letter in named] or range(6)
        if named:
            between = self._target(block, through=True)
            if not np.array_equal(between, self._state.pose, equal_nan=True):
                self._rapid(block, between, [AXES.index(letter) for letter in named])
        target = self._state.pose.copy()
        target[list(axes)] = [there[axis] for axis in axes]
        self._rapid(block, target, list(axes), in_machine=True)
        for letter in named:
            del block.words[letter]

    def _rapid(
        self, block: ProgramBlock, target: NDArray[np.float64], axes: list[int], *, in_machine: bool = False
    ) -> None:
        self._begin_move(block, target)
        unknown = (self.path.unknown & ~sum(1 << axis for axis in axes)) | bits_of(np.isnan(target))
        self.path.rapid(target, line=block.place.line, in_machine=in_machine, unknown=unknown)
        self._state.pose = target

    def _move(self, block: ProgramBlock) -> None:
        motion = block.code(ModalGroup.MOTION) if block.codes else None
        if motion is not None:
            self._begin_motion(motion)
        named = _named(block)
        if self._motion in CYCLES:
            if named or motion is not None:
                self._run_cycle(block, named)
            return
        once = block.code(ModalGroup.ONCE) if block.codes else None
        if once == MACHINE:
            self._check_machine(block.codes[ModalGroup.ONCE], block, named)
        if motion == LINEAR and once not in TAKES_AXES:
            self._check_feed(block, block.first_column)
        if named or self._goes_nowhere(block, motion, once):
            self._go_to(block, named, in_machine=once == MACHINE)

    def _go_to(self, block: ProgramBlock, named: list[str], *, in_machine: bool) -> None:
        if self._motion is None:
            what = f"{named[0]} without a motion code"
            raise block.place.fault(block.first_column, what, "write G0 or G1 before it")
        target = self._target(block, in_machine=in_machine)
        if self._motion == RAPID:
            self._rapid(block, target, [AXES.index(letter) for letter in named], in_machine=in_machine)
        elif self._motion == LINEAR:
            way = target - self._state.pose
            length = float(np.linalg.norm(way[:3])), float(np.linalg.norm(way[3:]))
            self._cut(block, target[None], length, in_machine=in_machine)
        else:
            arc = arc_of(
                block,
                self._state,
                target,
                clockwise=self._motion == CLOCKWISE,
                plane=self._plane,
                absolute=self._absolute_centres,
            )
            if len(self.path) + arc.chords > MOST_ROWS:
                raise _too_long(block)
            self._cut(block, arc.poses(), (arc.length_mm, 0.0), arc=arc.chord)
        for letter in (*named, *POLAR):
            block.words.pop(letter, None)

    def _begin_motion(self, motion: float) -> None:
        if motion in CYCLES and self._motion not in CYCLES:
            self._cycle.begun_at = float(self._state.pose[2])
        if motion != self._motion:
            self._cycle.numbers = {}
        self._motion = motion

    def _goes_nowhere(self, block: ProgramBlock, motion: float | None, once: float | None) -> bool:
        """Return whether a line without axes is a move: an arc by its centre; for LinuxCNC also a motion code alone."""
        if self._motion in ARCS and (motion is not None or any(each in block.words for each in CENTRES)):
            return True
        return motion in {RAPID, LINEAR} and not np.isnan(self._state.pose).any() and once not in TAKES_AXES

    def _cut(
        self,
        block: ProgramBlock,
        poses: NDArray[np.float64],
        length: tuple[float, float],
        *,
        in_machine: bool = False,
        arc: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    ) -> None:
        self._check_feed(block, block.first_column)
        self._begin_move(block, poses[-1])
        speed = self._speed
        if self._per_move:  # G93: one over the minutes of the move
            speed = Feed(*(max(each * self._speed.deg_min, LEAST_F) for each in length))
        self.path.feed(poses, *speed, line=block.place.line, in_machine=in_machine, arc=arc)
        self._state.pose = poses[-1]

    def _begin_move(self, block: ProgramBlock, target: NDArray[np.float64]) -> None:
        if not self._moved:
            if self._given and self._motion != RAPID:  # the begin of a cut is corrected as well
                self.path.rapid(self._state.pose, line=block.place.line)
            if not self._system_said:
                self._hold(IN_FORCE, self._state.offset_of(1))
            self._moved = True
        if self._upright and self._state.length_said and np.abs(target[3:5]).max() > 0.0:
            what = "A or B turns under G43.4, which would tilt the tool length"
            raise block.place.fault(block.first_column, what, "post the program for the tip, without G43.4")

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

    def _target(self, block: ProgramBlock, *, in_machine: bool = False, through: bool = False) -> NDArray[np.float64]:
        """Return the pose that a block leads to in machine coordinates, shape (6,)."""
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
            unknown = [letter for letter, value in zip(AXES, target, strict=True) if math.isnan(value)]
            if unknown:
                raise unknown_place(block, unknown)
        known = [value for value in target if not math.isnan(value)]
        if max(map(abs, known), default=0.0) > FARTHEST_DEG and (
            max((abs(value) for value in target[:3] if not math.isnan(value)), default=0.0) > FARTHEST_MM
            or max((abs(value) for value in target[3:] if not math.isnan(value)), default=0.0) > FARTHEST_DEG
        ):
            what = f"this move leads beyond {FARTHEST_MM:g} mm or {FARTHEST_DEG:g} degrees"
            raise block.place.fault(block.first_column, what, "check its numbers, and G91 and G20 before it")
        return np.array(target)

    def _by_angle(self, block: ProgramBlock, pose: list[float], offset: tuple[float, ...]) -> list[float]:
        """Return X and Y of polar coordinates about the origin, in machine coordinates [mm] [LinuxCNC, Polar Coordinates]."""
        radius_word, angle_word = (block.words.get(letter) for letter in POLAR)
        once = block.code(ModalGroup.ONCE)
        other = self._plane != 0 or ModalGroup.PLANE in block.codes or once in {*TAKES_AXES, MACHINE}
        if other or block.words.keys() & {"X", "Y"} or any(self._state.length[:2]):
            what = "polar coordinates (@, ^) go with moves in G17, without G53, X, Y and a tool length in these"
            raise block.place.fault(block.first_column, what, "write X and Y")
        x, y = (at - zero for at, zero in zip(pose[:2], offset, strict=False))
        radius, angle_deg = math.hypot(x, y), math.degrees(math.atan2(y, x))
        partly = not self._absolute or radius_word is None or angle_word is None
        if partly and math.isnan(radius):
            raise unknown_place(block, ["X", "Y"])
        if partly and radius < LEAST_MM and (radius_word is not None or not self._absolute):
            raise block.place.fault(block.first_column, "the origin has no angle (@, ^)", "write X and Y")
        if radius_word is not None:
            radius = radius_word.value * self._state.unit_mm + (0.0 if self._absolute else radius)
        if angle_word is not None:
            angle_deg = angle_word.value + (0.0 if self._absolute else angle_deg)
        angle = math.radians(angle_deg)
        return [radius * math.cos(angle) + offset[0], radius * math.sin(angle) + offset[1]]

    def _run_cycle(self, block: ProgramBlock, named: list[str]) -> None:
        column, code = block.first_column, self._motion or 0.0
        times = block.words.pop("L", None)
        if self._plane != 0 or self._per_move or {"A", "B", "C"} & set(named):
            what = f"{name('G', code)} with {'another plane than G17' if self._plane else 'G93, or A, B, C'}"
            raise block.place.fault(column, what, "post cycles as single moves")
        depths = self._cycle.depths(code, block, self._state, column, absolute=self._absolute)
        self._check_feed(block, column)
        corner, self.path.corner_mm = self.path.corner_mm, 0.0  # LinuxCNC follows the exact path there
        for _ in range(1 if times is None else int(times.value)):
            if self._cycle.begun_at < depths.clear:
                self._go(block, depth=depths.clear)
            self._rapid(block, self._target_of_cycle(block), [0, 1])
            self._go(block, depth=depths.clear)
            for step in cycle_steps(code, depths):
                self._cycle_step(block, step.what, step.depth)
        self.path.corner_mm = corner
        for letter in (*named, *POLAR):
            block.words.pop(letter, None)

    def _target_of_cycle(self, block: ProgramBlock) -> NDArray[np.float64]:
        motion, self._motion = self._motion, RAPID
        target = self._target(block)
        self._motion = motion
        return target

    def _cycle_step(self, block: ProgramBlock, what: str, depth: float) -> None:
        line = block.place.line
        if what == "dwell":
            if self._cycle.numbers.get("P", 0.0) > 0.0:
                self.path.dwell(self._cycle.numbers["P"], line=line)
        elif what in {"stop", "turn"}:
            if self._turning:
                self.path.say(RowKind.FUNCTION, "M5" if what == "stop" else self._turning, line=line)
        else:
            self._go(block, depth=depth, feed=what == "feed")

    def _go(self, block: ProgramBlock, *, depth: float, feed: bool = False) -> None:
        target = self._state.pose.copy()
        target[2] = depth
        if feed:
            self._cut(block, target[None], (0.0, 0.0))
        else:
            self._rapid(block, target, [2])

    def _stop(self, block: ProgramBlock) -> None:
        stop, call = block.code(ModalGroup.STOP), block.code(ModalGroup.CALL)
        if stop == PAUSE:
            self.path.say(RowKind.PAUSE, self._said_before(), line=block.place.line)
        elif stop == OPTIONAL_STOP:
            self.path.say(RowKind.OPTIONAL_STOP, "", line=block.place.line)
        elif stop is not None:
            self.path.ending = Ending(name("M", stop))
        if call == 99.0:  # noqa: PLR2004
            self.flow.back(block.place)
        elif call is not None:
            which, times = block.words.pop("P", None), block.words.pop("L", None)
            if which is None:
                raise block.place.fault(block.codes[ModalGroup.CALL].column, "M98 needs P", "give the O number")
            self.flow.call(which.value, 1.0 if times is None else times.value, block.place)

    def _said_before(self) -> str:
        """Return the message written before a stop, or the stop's own."""
        text = self.path.last_text.removeprefix(MESSAGE)
        is_own = (
            self.path.last_kind == RowKind.MESSAGE and self.path.last_text == MESSAGE + text and text == plain(text)
        )
        return self.path.taken_back().removeprefix(MESSAGE) if is_own else ""

    @staticmethod
    def _nothing_left(block: ProgramBlock) -> None:
        """Refuse words that the block does not use."""
        for letter, word in block.words.items():
            what = f"nothing in this line uses {letter}{word.value:g}"
            raise block.place.fault(word.column, what, "remove it, or give the code that it belongs to")


LAST_OWN = 5000
"""Parameters behind this are the control's own."""

LEAST_F = 1e-3
"""A move of no way under G93 has a feed all the same."""

_SHOWS_VALUES = re.compile(r"(?:debug|print|log),", re.IGNORECASE)
_SHOWN = re.compile(r"#(?:(\d+)|<([^<>]*)>)")


def _named(block: ProgramBlock) -> list[str]:
    """Return the axes that a block names, X and Y by polar coordinates too."""
    polar = "" if block.words.keys().isdisjoint(POLAR) else "XY"
    return [letter for letter in AXES if letter in block.words or letter in polar]


def _moved(block: ProgramBlock) -> int:
    return sum(letter in AXES for letter in block.words)


def _too_long(block: ProgramBlock) -> BadLine:
    what = f"up to here the program has more than {MOST_ROWS} moves, arcs as chords"
    return block.place.fault(0, what, "check the turns (P) of its arcs, or compensate it in parts")
