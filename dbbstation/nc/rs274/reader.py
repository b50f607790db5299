"""Convert blocks to a toolpath by the modal state of a control."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, InputError, Problem
from dbbstation.nc.dialect import plain
from dbbstation.nc.rs274.blocks import CYCLES, ModalGroup, ProgramBlock, block_of, name
from dbbstation.nc.rs274.lines import LEAST_LINES
from dbbstation.nc.rs274.state import AXES, unknown_place, unplaced
from dbbstation.nc.rs274.tokens import BadLine
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.spilled import LongText
from dbbstation.nc.toolpath import (
    MESSAGE,
    Ending,
    RowKind,
    Toolpath,
    going_on,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.flow import Flow
    from dbbstation.nc.rs274.tokens import Place


from dbbstation.nc.rs274.modes import DWELL, LINEAR, MACHINE, RAPID, TAKES_AXES, Feed, Stored
from dbbstation.nc.rs274.moves import FARTHEST_DEG, MOST_ROWS, Moves, named_axes, too_long

NO_END = "the program ends without M2, M30 or %: check that it is whole"

AXES_ALONE = frozenset(AXES)

PAUSE, OPTIONAL_STOP = 0.0, 1.0
ENDS = frozenset({2.0, 30.0})


def read_program(
    text: str | LongText, file: str, *, start: Floats | None = None, setup: ControlSetup | None = None
) -> Toolpath:
    """Return the toolpath that a program commands.

    Args:
        start: pose before the program, shape (6,) [mm, deg], NaN for unknown axes; None: all unknown.
        setup: offsets and tool lengths of the control; None: all zero.

    Raises:
        InputError: faults with line and column; all unreadable words at once, or the first block that makes no sense.
    """
    interpreter = _Interpreter(LongText.of(text).lines(), file, start, setup or ControlSetup())
    try:
        interpreter.run_all()
    except BadLine as fault:
        raise InputError(_unreadable(interpreter.flow) or [fault.problem]) from None
    interpreter.path.files = interpreter.flow.files
    return interpreter.path.built()


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


class _Interpreter(Moves):
    _alone_until = 0
    """Lines before this one run alone: they were read together, and none of them could begin a common run."""

    def run_all(self) -> None:
        """Run all blocks to the program's end.

        Raises:
            BadLine: the first one that makes no sense.
        """
        for line, place in self.flow.lines():
            if self._stored:
                self._end_stored(place)
            if self._ran_lines(place.line):
                continue
            block = block_of(line, place, self.flow.value_of)
            self._set(block)
            self.run(block)
            if block.code(ModalGroup.STOP) in ENDS:
                self.flow.ended()
                break
        else:
            # What stops its spindle, or leaves behind the last cut, ends without M2, as for GRBL.
            leaves = self.path.fed > 0 and (self.path.fed < self.path.left or (self._stopped and not self._turning))
            if not (self.flow.closed or (leaves and not self.flow.percent)):
                raise BadLine(self.flow.cut_short())
            if not self.flow.closed:
                self.path.notes += (NO_END,)
        if self._moved:
            self._check_places(block)

    def _check_places(self, block: ProgramBlock) -> None:
        unknown = [letter for letter in unplaced(self._state.pose) if AXES.index(letter) not in self._away]
        place, fault = self._unplaced or (block.place, unknown_place(block, unknown, ""))
        if unknown:
            raise fault
        if self._unplaced is not None:
            what = f"{place}: {fault.problem.what}: what leads there is corrected for where it names them first"
            self.path.notes += (what,)

    def _end_stored(self, place: Place) -> None:
        for level in [each for each in self._stored if each not in self.flow.runs]:
            stored = self._stored.pop(level)
            if stored.by_itself:
                self._bring_back(stored, place)

    def _store(self, block: ProgramBlock) -> None:
        """Run M70 to M73, which store and restore modes [LinuxCNC, M70 to M73]."""
        code, level = block.code(ModalGroup.STATE), self.flow.runs[-1]
        if code in {70.0, 73.0}:
            modes = self._speed, self.path.corner_mm, self._cycle.to_clear, self._state.length
            self._stored[level] = Stored(dict(self._in_force), self._spindle_speed, modes, by_itself=code == 73.0)  # noqa: PLR2004
            return
        if level not in self._stored:
            what = f"M{code:g} without modes that were stored"
            raise block.fault(what, "write M70 before it", block.codes[ModalGroup.STATE])
        if code == 72.0:  # noqa: PLR2004
            self._bring_back(self._stored[level], block.place)
        else:
            del self._stored[level]

    def _bring_back(self, stored: Stored, place: Place) -> None:
        speed, corner_mm, to_clear, length = stored.modes
        changed = [code for group, code in stored.codes.items() if code != self._in_force[group]]
        changed += [stored.spindle_speed] if stored.spindle_speed != self._spindle_speed else []
        if self._cutter is not None or length != self._state.length or not all(changed):
            what = "stored modes would change a work system that no line names, a tool length or G41"
            raise place.fault(1, what, "write the modes that apply from here on")
        for code in changed:
            self.run(block_of(code, place))
        self._speed, self.path.corner_mm, self._cycle.to_clear = speed, corner_mm, to_clear

    def _ran_lines(self, first: int) -> bool:
        """Run this line of axes together with those that follow; return False if it must run alone."""
        ready = self._moved and self._absolute and self._motion in {RAPID, LINEAR}
        alone = self._per_move, self._upright, self.path.unknown, self._cutter, self._unsure_feed, self._since_cycle
        if not ready or first < self._alone_until or any(alone):
            return False
        lines, unit_mm = self.flow.plain_lines(), self._state.unit_mm
        if len(lines.axes) < LEAST_LINES:
            return False
        modal = np.column_stack([lines.motion, lines.feed])
        motion, feed = going_on(modal, np.array([self._motion, self._speed.deg_min])).T
        scale = np.array([unit_mm] * 3 + [1.0] * 3)
        poses = going_on(lines.axes * scale + np.array(self._state.offset), self._state.pose)
        bad = ((motion == LINEAR) & (feed <= 0.0)) | (np.abs(poses).max(axis=1) >= FARTHEST_DEG)
        bad[max(MOST_ROWS - len(self.path), 0) :] = True
        end = int(np.argmax(bad)) if bad.any() else len(bad)
        if end == 0:
            self._alone_until = first + (len(bad) if bad.all() else int(np.argmin(bad)))
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
        numbered = lines.numbers[:end][lines.numbers[:end] >= 0]
        numbers = (*self.path.numbers, *numbered[[0, -1]].tolist()) if len(numbered) else self.path.numbers
        self.path.numbers = (*numbers[:1], *numbers[1:][-1:])
        self.flow.skip(end - 1)
        return True

    def run(self, block: ProgramBlock) -> None:
        """Execute one block in the order of [RS274/NGC 3.8]."""
        if "N" in block.words:
            self.path.numbers = (*self.path.numbers[:1], int(block.words.pop("N").value))
        if block.comments or block.message:
            self._said(block)
        if block.codes or self._per_move or block.words.keys() - AXES_ALONE:
            self._units(block)
            self._feed(block)
            self._shared_words(block)
            self._functions(block)
            if block.code(ModalGroup.ONCE) == DWELL:
                self.path.dwell(self._dwell_s(block), line=block.place.line)
            self._modes(block)
            self._note(block)
            self._cutter_radius(block)
            self._tool_length(block)
            self._offsets(block)
        self._move(block)
        if ModalGroup.STATE in block.codes:
            self._store(block)
        if block.codes:
            self._stop(block)
        self._nothing_left(block)
        if len(self.path) > MOST_ROWS:
            raise too_long(block)

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
            if system:
                self._hold(system, before)
            self._system(told, block)
        elif code in {28.0, 30.0}:
            self._to_reference(block)

    def _to_reference(self, block: ProgramBlock) -> None:
        word = block.codes[ModalGroup.ONCE]
        code, named = name("G", word.value), [letter for letter in AXES if letter in block.words]
        there = self._state.setup.place(code)
        axes = [AXES.index(letter) for letter in named]
        if named:
            between = self._target(block, through=True)
            if not np.array_equal(between, self._state.pose, equal_nan=True):
                self._rapid(block, between, axes)
        if there is None:
            self._somewhere(code, axes, block)
        else:
            axes = axes or list(range(6))
            target = self._state.pose.copy()
            target[axes] = [there[axis] for axis in axes]
            self._rapid(block, target, axes, in_machine=True)
        for letter in named:
            del block.words[letter]

    def _somewhere(self, code: str, axes: list[int], block: ProgramBlock) -> None:
        """Write a move to a reference point of undeclared position as it is: only the control knows the path."""
        axes = axes or [axis for axis in range(6) if not self._fixed >> axis & 1]
        self._system(f"G91 {code} {' '.join(f'{AXES[axis]}0' for axis in axes)}\nG90", block)
        self._state.pose = self._state.pose.copy()
        self._state.pose[axes] = math.nan
        self._away |= set(axes)
        self.path.unknown |= sum(1 << axis for axis in axes)

    def _move(self, block: ProgramBlock) -> None:
        motion = block.code(ModalGroup.MOTION) if block.codes else None
        if motion is not None:
            self._begin_motion(motion)
        named = named_axes(block)
        if self.is_curve(block):
            self._curve(block, named)
            return
        if self._motion in CYCLES:
            if named or motion is not None:
                self._run_cycle(block, named)
            return
        once = block.code(ModalGroup.ONCE) if block.codes else None
        if once == MACHINE:
            self._check_machine(block.codes[ModalGroup.ONCE], block, named)
        if motion == LINEAR and once not in TAKES_AXES:
            self._check_feed(block)
        if named or self._goes_nowhere(block, motion, once):
            self._go_to(block, named, in_machine=once == MACHINE)

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
            which, times = block.take("P"), block.take("L")
            if which is None:
                raise block.fault("M98 needs P", "give the O number", block.codes[ModalGroup.CALL])
            self.flow.call(which.value, 1.0 if times is None else times.value, block.place)

    def _said_before(self) -> str:
        text = self.path.last_text.removeprefix(MESSAGE)
        is_own = (
            self.path.last_kind == RowKind.MESSAGE and self.path.last_text == MESSAGE + text and text == plain(text)
        )
        return self.path.taken_back().removeprefix(MESSAGE) if is_own else ""

    @staticmethod
    def _nothing_left(block: ProgramBlock) -> None:
        for letter, word in block.words.items():
            what = f"nothing in this line uses {letter}{word.value:g}"
            raise block.fault(what, "remove it, or give the code that it belongs to", word)
