"""Modal state of a control, and the words of a block that change it."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.nc.rs274.blocks import CURVES, CYCLES, NEEDED, STORED, ModalGroup, name
from dbbstation.nc.rs274.flow import Flow
from dbbstation.nc.rs274.state import AXES, CENTRES, ControlState, ModalCycle
from dbbstation.nc.rs274.tokens import shown
from dbbstation.nc.toolpath import (
    ALL_AXES,
    EXACT_STOP_MM,
    Ending,
    RowKind,
    ToolpathBuilder,
    bits_of,
)
from dbbstation.nc.words import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.cutter import Beside, Cutter
    from dbbstation.nc.rs274.tokens import BadLine, Place, Word
    from dbbstation.nc.setup import ControlSetup


MM_PER_INCH = 25.4

RAPID, LINEAR, CLOCKWISE, COUNTER_CLOCKWISE = 0.0, 1.0, 2.0, 3.0
ARCS = frozenset({CLOCKWISE, COUNTER_CLOCKWISE})
DWELL, MACHINE, SET_TOOL = 4.0, 53.0, 61.0
TAKES_AXES = frozenset({10.0, 28.0, 30.0, 52.0, 92.0})
"""Codes that use the axis words of their line."""

POLAR = "@^"
"""Letters of radius and angle in degrees, which replace X and Y."""

TURNS = 0b111000
"""A, B and C. If they were declared, the program assumes that no tool changer moves them."""


LONG_S = 99.0
"""Longer dwells are reported: they may be meant in milliseconds."""

LAST_OWN = 5000
"""Parameters with greater numbers belong to the control."""

_SHOWS_VALUES = re.compile(r"(?:debug|print|log),", re.IGNORECASE)
_SHOWN = re.compile(r"#(?:(\d+)|<([^<>]*)>)")


_BY_M = frozenset({ModalGroup.SPINDLE, ModalGroup.COOLANT, ModalGroup.OVERRIDE})

_NOT_BESIDE = frozenset(
    {
        ModalGroup.UNITS,
        ModalGroup.PLANE,
        ModalGroup.FEED_MODE,
        ModalGroup.TOOL_LENGTH,
        ModalGroup.TOOL,
        ModalGroup.OFFSET,
        ModalGroup.ONCE,
    }
)
"""Codes that are refused while a contour is compensated."""

_BEHIND_CUTTER = frozenset({ModalGroup.TOOL_LENGTH, ModalGroup.OFFSET, ModalGroup.ONCE})
"""Those that LinuxCNC runs after G41 in its line, and refuses there."""


class Feed(NamedTuple):
    """Meaning of F: speed of the tool tip, or of the angles if only they move."""

    mm_min: float
    deg_min: float


class Stored(NamedTuple):
    """Modes that M70 or M73 stored.

    Attributes:
        codes: in force, by group.
        modes: F, rounding of corners, retract mode, tool length.
        by_itself: they come back at the end of the subprogram (M73).
    """

    codes: dict[ModalGroup, str]
    spindle_speed: str
    modes: tuple[Feed, float | None, bool | None, tuple[float, ...]]
    by_itself: bool


class Modes:
    """Modal state; initially as in LinuxCNC, in millimetres."""

    def __init__(self, text: NDArray[np.uint8], file: str, start: Floats | None, setup: ControlSetup) -> None:
        self.path = ToolpathBuilder(file, start)
        self.path.ending = Ending.TEXT  # unless a block says otherwise
        self.path.units_said = False
        pose = np.full(6, np.nan) if start is None else np.array(start, dtype=np.float64)
        self._state = ControlState(setup, pose)
        self.flow = Flow(text, file, self._state.parameter, setup)
        self._given = not np.isnan(pose).any()
        self._fixed = bits_of(~np.isnan(pose)) & TURNS
        self._motion: float | None = None
        self._before_cycle: float | None = None
        self._since_cycle = False
        self._speed = Feed(0.0, 0.0)
        self._per_move = False
        self._absolute = True
        self._absolute_centres = False
        self._plane = 0
        self._cycle = ModalCycle()
        self._turning, self._stopped = "", False
        self._upright = self._moved = False
        self._away: set[int] = set()
        self._in_force, self._spindle_speed = dict(STORED), "S0"
        self._stored: dict[int, Stored] = {}
        self._cutter: Cutter | None = None
        self._beside: Beside | None = None
        self._radius_number: Word | None = None
        self._left_contour = False
        self._unplaced: tuple[Place, BadLine] | None = None
        self._unsure_feed: BadLine | None = None
        self._feed_unit_mm = 1.0
        self._system_said = False
        self.path.holds = {}
        self.path.count_from(self._state.offset)
        if any(self._state.g92):
            self._hold("G92", self._state.g92)

    def _set(self, block: ProgramBlock) -> None:
        for which, value, column in block.settings:
            if which > LAST_OWN if isinstance(which, int) else self._state.parameter(which) is not None:
                what = f"{shown(which)} is the control's own"
                raise block.fault(what, "set offsets with G10 L2, and lengths with --tool-lengths-mm", column)
            self.flow.set(which, value)

    def _said(self, block: ProgramBlock) -> None:
        for comment in block.comments:
            if comment:
                self.path.say(RowKind.COMMENT, comment, line=block.place.line)
        if block.message:
            self.path.say(RowKind.MESSAGE, self._with_values(block.message), line=block.place.line)

    def _with_values(self, message: str) -> str:
        if not _SHOWS_VALUES.match(message):
            return message

        def value(match: re.Match[str]) -> str:
            known = self.flow.value_of(int(match[1]) if match[1] else match[2].lower())
            return match[0] if known is None else f"{known:f}"

        return _SHOWN.sub(value, message)

    def _units(self, block: ProgramBlock) -> None:
        units, self._feed_unit_mm = block.code(ModalGroup.UNITS), self._state.unit_mm
        if "F" in block.words:
            self._unsure_feed = None
        if units is None:
            return
        self.path.units_said = True
        unit_mm = MM_PER_INCH if units == 20.0 else 1.0  # noqa: PLR2004
        # LinuxCNC sets the feed before it changes units, so F still counts in the old ones.
        if unit_mm > self._state.unit_mm and "F" in block.words:
            said = f"F{block.words['F'].value:g} in the line of G20 counts in millimetres, as in LinuxCNC; inches would be faster"
            self.path.notes += (f"{block.place}: {said}",)
        elif unit_mm != self._state.unit_mm and "F" in block.words:
            code = name("G", units)
            what = f"F in the line of {code} counts in the units before it on some controls and after it on others"
            self._unsure_feed = block.fault(
                what, f"write {code} in a line before, or F in the next cut", block.words["F"]
            )
        self._state.unit_mm = unit_mm

    def _feed(self, block: ProgramBlock) -> None:
        if ModalGroup.FEED_MODE in block.codes:
            # LinuxCNC forgets F at every G94, even where it was in force already.
            self._per_move = block.code(ModalGroup.FEED_MODE) == 93.0  # noqa: PLR2004
            self._speed = Feed(0.0, 0.0)
        elif self._per_move:
            self._speed = Feed(0.0, 0.0)  # each move has its own
        word = block.take("F")
        if word is not None:
            if word.value < 0.0:
                raise block.fault(f"the feed is negative (F{word.value:g})", "give a positive feed", word)
            # Degrees are degrees in G20 as well: only the speed of the tool tip counts in inches.
            self._speed = Feed(word.value * self._feed_unit_mm, word.value)

    def _functions(self, block: ProgramBlock) -> None:
        speed, tool = block.words.get("S"), block.words.get("T")
        if speed is not None and speed.value < 0.0:
            raise block.fault(f"the spindle's speed is negative (S{speed.value:g})", "use M3 or M4", speed)
        if tool is not None and not tool.counts(0.0):
            raise block.fault(f"T{tool.value:g} is no tool", "give a whole number", tool)
        change, number_set = block.codes.get(ModalGroup.TOOL), None
        if change is not None and change.value == SET_TOOL:
            number_set = block.take("Q")
            if number_set is None or not number_set.counts(0.0):
                raise block.fault("M61 needs Q", "give the number of the tool", change)
        said = [block.take("T"), change, number_set]
        said += [block.codes.get(ModalGroup.SPEED), block.take("S")]
        self._spindle_speed = self._spindle_speed if speed is None else f"S{speed.value:g}"
        said += [block.codes.get(group) for group in (ModalGroup.SPINDLE, ModalGroup.COOLANT, ModalGroup.OVERRIDE)]
        output, switch = (block.codes.get(group) for group in (ModalGroup.OUTPUT, ModalGroup.SWITCH))
        if self._stored and switch is not None:
            what = f"M{switch.value:g} between modes that are stored (M70, M73) and come back"
            raise block.fault(what, "write it before them, or behind", switch)
        needed = "" if output is None else NEEDED.get(output.value, "")
        if output is not None and needed and needed not in block.words:
            raise block.fault(f"M{output.value:g} needs {needed}", "give the output's number", output)
        said += [output, switch, *(block.take(letter) for letter in "EPQ" if output or switch)]
        text = " ".join(f"{word.letter}{number(word.value)}" for word in said if word is not None)
        if text:
            self.path.say(RowKind.FUNCTION, text, line=block.place.line)
        if ModalGroup.SPINDLE in block.codes:
            turning = name("M", block.codes[ModalGroup.SPINDLE].value)
            self._stopped |= bool(self._turning) and turning == "M5"
            self._turning = "" if turning == "M5" else turning
        if tool is not None:
            self._state.tool_selected = int(tool.value)
        self._change_tool(change, number_set)

    def _change_tool(self, change: Word | None, number_set: Word | None) -> None:
        if number_set is not None:
            self._state.tool = int(number_set.value)
        elif change is not None:
            self._state.tool = self._state.tool_selected
            self._turning = ""
            if self._left_contour:  # numbers go on from where the machine stands
                self._state.pose = self.path.pose
            # A tool changer may move the machine: what no line names again before the next cut is not to be named either.
            self.path.unknown |= ALL_AXES & ~self._fixed

    def _shared_words(self, block: ProgramBlock) -> None:
        if not block.codes:
            return
        users = [self._in_line(block, ModalGroup.ONCE, {DWELL, 10.0}), self._in_line(block, ModalGroup.PATH, {64.0})]
        users += [self._in_line(block, ModalGroup.MOTION, ARCS) or self._modal_arc(block)]
        outputs = (block.codes.get(group) for group in (ModalGroup.OUTPUT, ModalGroup.SWITCH))
        users += [name("M", word.value) for word in outputs if word is not None]
        both = [code for code in users if code]
        if len(both) > 1 and ("P" in block.words or both[0] == name("G", DWELL)):
            what = f"{' and '.join(both)} both take P"
            raise block.fault(what, "write them in separate lines", block.words.get("P", 1))
        once = block.code(ModalGroup.ONCE)
        if once in TAKES_AXES and block.code(ModalGroup.MOTION) not in {None, RAPID, LINEAR}:
            what = f"{name('G', once or 0.0)} and {name('G', block.codes[ModalGroup.MOTION].value)} both take axes"
            raise block.fault(what, "write them in separate lines", block.codes[ModalGroup.ONCE])

    @staticmethod
    def _in_line(block: ProgramBlock, group: ModalGroup, values: set[float] | frozenset[float]) -> str:
        value = block.code(group)
        return name("G", value) if value in values and value is not None else ""

    def _modal_arc(self, block: ProgramBlock) -> str:
        """Return the arc code of a line without motion code; empty if the line is no arc."""
        is_arc = self._motion in ARCS and ModalGroup.MOTION not in block.codes
        return name("G", self._motion or 0.0) if is_arc and block.words.keys() & set(AXES + CENTRES + POLAR) else ""

    def _dwell_s(self, block: ProgramBlock) -> float:
        word = block.take("P") or block.take("X")  # X as for Fanuc
        if word is None or word.value < 0.0:
            what = "G4 needs the seconds to wait"
            raise block.fault(what, "write G4 P0.5 for half a second", block.codes[ModalGroup.ONCE])
        if word.value > LONG_S:
            said = f"{block.place} waits {word.value:g} s: LinuxCNC counts seconds, some controls milliseconds"
            self.path.notes += (said,)
        return word.value

    def _modes(self, block: ProgramBlock) -> None:
        plane, distance = block.code(ModalGroup.PLANE), block.code(ModalGroup.DISTANCE)
        centres, back = block.code(ModalGroup.ARC_DISTANCE), block.code(ModalGroup.RETRACT)
        self._plane = self._plane if plane is None else int(plane) - 17
        self._absolute = self._absolute if distance is None else distance == 90.0  # noqa: PLR2004
        self._absolute_centres = self._absolute_centres if centres is None else centres == 90.1  # noqa: PLR2004
        self._cycle.to_clear = self._cycle.to_clear if back is None else back == 99.0  # noqa: PLR2004
        if ModalGroup.CYCLE_END in block.codes:
            # LinuxCNC has no motion from here on, other controls the one before the cycle.
            before = self._before_cycle if self._motion in CYCLES else self._motion
            self._motion, self._cycle.numbers = RAPID if before == RAPID else None, {}
            self._since_cycle = self._motion is not None
        if ModalGroup.PATH in block.codes:
            self._path_control(block)
        if ModalGroup.SMOOTHING in block.codes and not self.is_curve(block):
            self._smoothing(block)

    def _cutter_radius(self, block: ProgramBlock) -> None:
        word, block_number = block.codes.get(ModalGroup.CUTTER), block.take("D")
        number = self._radius_number = block_number or self._radius_number
        changes = block.codes.keys() & (_NOT_BESIDE if word is None else _BEHIND_CUTTER)
        changes -= {ModalGroup.ONCE} if block.code(ModalGroup.ONCE) == DWELL else set()
        begins = word is not None and word.value != 40.0  # noqa: PLR2004
        if changes and (begins or (word is None and self._cutter is not None)):
            what = "beside a contour (G41, G42) the line changes what moves mean"
            raise block.fault(what, "write it before the contour or behind G40", block.codes[min(changes)])
        if word is None:
            return
        if not begins:
            self._left_contour = self._beside is not None
            self._cutter = self._beside = None
            return
        if self._cutter is not None or self._plane > 1 or self._per_move:
            code = name("G", word.value)
            what = f"{code} {'while another one is in force' if self._cutter else 'in G19 or under G93'}"
            raise block.fault(what, "write G40 before it, and G17 or G18 and G94", word)
        is_left = int(word.value) == 41  # noqa: PLR2004
        radius_mm = self._diameter_mm(block, word, number) / 2.0
        self._left_contour = False
        if radius_mm != 0.0:
            from dbbstation.nc.rs274.cutter import Cutter  # noqa: PLC0415 - most programs name no side of a contour

            self._cutter = Cutter(1 if is_left == (radius_mm > 0.0) else -1, abs(radius_mm))

    def _diameter_mm(self, block: ProgramBlock, word: Word, number: Word | None) -> float:
        if word.value != int(word.value):  # G41.1 and G42.1 name a diameter
            if number is None:
                raise block.fault(f"{name('G', word.value)} needs D", "give the diameter", word)
            return number.value * self._state.unit_mm
        tool = self._state.tool if number is None else number.value
        if tool is None or tool not in self._state.diameters:
            what = f"the diameter of tool {'in the spindle' if tool is None else f'{tool:g}'} is not known"
            raise block.fault(what, "give LinuxCNC's tool table with --tools", word)
        diameter_mm = self._state.diameters[int(tool)]
        if tool not in self._state.tools_set:
            self._hold(f"D{tool:g}", (diameter_mm,))
        return diameter_mm

    def _note(self, block: ProgramBlock) -> None:
        self._in_force |= {
            group: name("M" if group in _BY_M else "G", word.value)
            for group, word in block.codes.items()
            if group in STORED
        }

    def _path_control(self, block: ProgramBlock) -> None:
        word = block.codes[ModalGroup.PATH]
        corner = 0.0 if word.value == 61.0 else EXACT_STOP_MM  # noqa: PLR2004
        if word.value == 64.0:  # noqa: PLR2004
            allowed, _ = block.take("P"), block.take("Q")
            # LinuxCNC takes P0 for no bound, as if P were not there.
            corner = allowed.value * self._state.unit_mm if allowed is not None and allowed.value > 0.0 else math.inf
        self.path.corner_mm = corner

    @staticmethod
    def is_curve(block: ProgramBlock) -> bool:
        """Return whether a line is a curve: G5 or G5.1 with axes or I and J."""
        words = block.words.keys() & {*AXES, *CENTRES, *POLAR}
        return bool(words) and block.code(ModalGroup.SMOOTHING) in {5.0, 5.1}

    def _smoothing(self, block: ProgramBlock) -> None:
        """Remove high-speed modes of other controls (G5 P, G5.1 Q, G187)."""
        word, said = block.codes[ModalGroup.SMOOTHING], [block.take(letter) for letter in "EPQR"]
        if block.words.keys() & set(AXES + CENTRES):
            raise block.fault(f"{name('G', word.value)} with axes is not read", CURVES, word)
        text = " ".join(f"{each.letter}{each.value:g}" for each in (word, *said) if each is not None)
        self.path.say(RowKind.COMMENT, f"{text} is left out", line=block.place.line)

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
                raise block.fault(what, "post the program for the tip, without G43.4", word)
            self._upright = True  # A and B must stay so: G43.4 would tilt the tool length
        tool = block.take("H")
        which = self._state.use_length(tool, block, word)
        if which not in self._state.tools_set:  # what the program sets itself needs no check
            self._hold(f"H{which}", self._state.length)
        self._system(f"G43 H{which}", block)

    def _system(self, text: str, block: ProgramBlock) -> None:
        self.path.say(RowKind.SYSTEM, text, line=block.place.line)
        self.path.count_from(self._state.offset)

    def _hold(self, what: str, values: tuple[float, ...]) -> None:
        held = {} if self.path.holds is None else self.path.holds
        held.setdefault(what, values)
        self.path.holds = held
        self.path.count_from(self._state.offset)
