"""Blocks: the sorted words of one line, checked for conflicts.

The reader accepts some G and M codes, which have modal groups, and refuses others with a reason.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.nc.rs274.tokens import BadLine, Comment, ParameterSetting, Place, Word, tokens, unknown_value
from dbbstation.nc.toolpath import SYSTEMS

if TYPE_CHECKING:
    from collections.abc import Callable


class ModalGroup(StrEnum):
    """Groups of codes: one line must not have two codes of one group."""

    MOTION = "motion"
    ONCE = "not modal"
    PLANE = "plane"
    UNITS = "units"
    DISTANCE = "distance"
    ARC_DISTANCE = "arc distance"
    FEED_MODE = "feed mode"
    CUTTER = "cutter compensation"
    TOOL_LENGTH = "tool length"
    RETRACT = "retract"
    OFFSET = "work offset"
    PATH = "path control"
    SMOOTHING = "how smoothly the control moves"
    SPEED = "spindle speed"
    NOTHING = "ends what is not read"
    CYCLE_END = "end of a cycle"
    STOP = "stop"
    TOOL = "tool change"
    SPINDLE = "spindle"
    COOLANT = "coolant"
    OVERRIDE = "override switches"
    SWITCH = "one override switch"
    CALL = "subprogram"
    STATE = "stored modes"
    OUTPUT = "output, or function of one's own"


TAPS = {74.0: "M4", 84.0: "M3"}
"""Tapping cycles, and the spindle's direction before each."""

CYCLES = (73, *TAPS, 81, 82, 83, 85, 86, 89)

G_CODES: dict[float, ModalGroup] = {
    **dict.fromkeys((0, 1, 2, 3, *CYCLES), ModalGroup.MOTION),
    **dict.fromkeys((4, 10, 28, 30, 52, 53, 92, 92.1, 92.2, 92.3), ModalGroup.ONCE),
    **dict.fromkeys((17, 18, 19), ModalGroup.PLANE),
    **dict.fromkeys((20, 21), ModalGroup.UNITS),
    **dict.fromkeys((40, 41, 41.1, 42, 42.1), ModalGroup.CUTTER),
    **dict.fromkeys((43, 43.4, 49), ModalGroup.TOOL_LENGTH),
    **{float(name[1:]): ModalGroup.OFFSET for name in SYSTEMS},
    **dict.fromkeys((61, 61.1, 64), ModalGroup.PATH),
    **dict.fromkeys((15, 50, 50.1, 69), ModalGroup.NOTHING),
    **dict.fromkeys((5, 5.1, 8, 103, 187), ModalGroup.SMOOTHING),
    80: ModalGroup.CYCLE_END,
    **dict.fromkeys((90, 91), ModalGroup.DISTANCE),
    **dict.fromkeys((90.1, 91.1), ModalGroup.ARC_DISTANCE),
    **dict.fromkeys((93, 94), ModalGroup.FEED_MODE),
    97: ModalGroup.SPEED,
    **dict.fromkeys((98, 99), ModalGroup.RETRACT),
}

EXCLUDED = {
    ModalGroup.OVERRIDE: ModalGroup.SWITCH,
    ModalGroup.SPINDLE: ModalGroup.STATE,
    ModalGroup.STOP: ModalGroup.CALL,
}
EXCLUDED |= {other: group for group, other in EXCLUDED.items()}
"""Groups that are one in LinuxCNC."""

NEEDED = {**dict.fromkeys((62.0, 63.0, 64.0, 65.0), "P"), 67.0: "E", 68.0: "E"}
"""Letter without which LinuxCNC refuses an output."""

M_CODES: dict[float, ModalGroup] = {
    **dict.fromkeys((0, 1, 2, 30), ModalGroup.STOP),
    **dict.fromkeys((3, 4, 5), ModalGroup.SPINDLE),
    **dict.fromkeys((6, 61), ModalGroup.TOOL),
    **dict.fromkeys((7, 8, 9), ModalGroup.COOLANT),
    **dict.fromkeys((48, 49), ModalGroup.OVERRIDE),
    **dict.fromkeys((50, 51, 52, 53), ModalGroup.SWITCH),
    **dict.fromkeys((98, 99), ModalGroup.CALL),
    **dict.fromkeys((70, 71, 72, 73), ModalGroup.STATE),
    **dict.fromkeys((*NEEDED, *range(100, 198), 199), ModalGroup.OUTPUT),
}

STORED: dict[ModalGroup, str] = {
    ModalGroup.UNITS: "G21",
    ModalGroup.PLANE: "G17",
    ModalGroup.FEED_MODE: "G94",
    ModalGroup.DISTANCE: "G90",
    ModalGroup.ARC_DISTANCE: "G91.1",
    ModalGroup.OFFSET: "",
    ModalGroup.SPINDLE: "M5",
    ModalGroup.COOLANT: "M9",
    ModalGroup.OVERRIDE: "M48",
}
"""Groups that M70 to M73 store, in the order of their restoration, with each group's code at the begin of a program;
empty: unknown."""

LETTERS = frozenset("ABCDEFGHIJKLMNPQRSTXYZ@^")

CURVES = "post curves as lines or arcs"
_TURNED = "post the program without rotation: the model is not turned with it"
_SPINDLE = "motion that follows the spindle has no path in time: run it without compensation"
_REMEDIES: dict[float, str] = {
    **dict.fromkeys((43.1, 43.2, 43.5), "post the program with G43 and H"),
    **dict.fromkeys((5.2, 5.3, 6.2), CURVES),
    **dict.fromkeys((32, 33, 33.1, 76, 84.2, 84.3, 95, 96), _SPINDLE),
    **dict.fromkeys(
        (31, 38, 38.2, 38.3, 38.4, 38.5), "where probing ends is not known before: run it without compensation"
    ),
    **dict.fromkeys((28.1, 30.1), "set reference points by hand, not in the program"),
    **dict.fromkeys((51, 51.1, 68, 68.2), _TURNED),
    7: "post the program with radii",
    **dict.fromkeys((54.1, 154), "post the program with G54 to G59.3"),
    **dict.fromkeys(
        (70, 71), "it is inch or millimetre on some controls, a cycle of lathes on others: write G20 or G21"
    ),
    72: "a cycle of lathes: post its single moves",
    **dict.fromkeys((87, 88), "post this cycle as single moves"),
}


def name(letter: str, value: float) -> str:
    """Return a code as people write it: G1, G91.1."""
    return f"{letter}{value:.10g}"


def remedy(letter: str, value: float) -> str:
    """Return the remedy for an unsupported code."""
    return "post the program without it" if letter == "M" else _REMEDIES.get(value, "post the program without it")


BLANKS = " \t\r"

LONGEST_BYTES = 252
"""LinuxCNC's interpreter refuses longer lines; a CR before the line feed counts as a byte [measured with rs274 2.9]."""

_CONTROL = re.compile("[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029]")
"""All control characters except the tab, and Unicode's line separators."""


@dataclass(slots=True)
class ProgramBlock:
    """One line.

    Attributes:
        codes: G and M codes by group.
        message: a comment that LinuxCNC acts on; empty if none.
    """

    place: Place
    words: dict[str, Word] = field(default_factory=dict)
    codes: dict[ModalGroup, Word] = field(default_factory=dict)
    settings: list[ParameterSetting] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    message: str = ""

    def take(self, letter: str) -> Word | None:
        """Return the word of a letter, which is then used, or None."""
        return self.words.pop(letter, None)

    def code(self, group: ModalGroup) -> float | None:
        """Return the code of a group, or None."""
        word = self.codes.get(group)
        return None if word is None else word.value

    @property
    def first_column(self) -> int:
        """Return the column of the first word that is neither code nor line number; if there is none, of the first code."""
        words = [word.column for word in self.words.values()]
        return min(words) if words else next((word.column for word in self.codes.values()), 1)

    def fault(self, what: str, remedy: str, at: Word | Comment | int | None = None) -> BadLine:
        """Return the exception for a fault at a word, a column or the first word."""
        column = self.first_column if at is None else at if isinstance(at, int) else at.column
        return self.place.fault(column, what, remedy)


def block_of(line: str, place: Place, value_of: Callable[[int | str], float | None] = unknown_value) -> ProgramBlock:
    """Return the block of a line.

    Raises:
        BadLine: the first thing in it that cannot be read.
    """
    block = ProgramBlock(place)
    for token in tokens(_checked(line, place), place, value_of):
        if isinstance(token, Comment):
            _take_comment(block, token)
        elif isinstance(token, ParameterSetting):
            block.settings.append(token)
        elif token.letter in "GM":
            _take_code(block, token)
        elif token.letter not in LETTERS:
            what = f"words with the letter {token.letter} are not read ({token.letter}{token.value:g})"
            why = "the model has no such axis: " if token.letter in "UVW" else ""
            raise place.fault(token.column, what, f"{why}post the program without it")
        elif token.letter == "N" and (block.words or block.codes or block.comments):
            raise place.fault(
                token.column, "the line number N is not at the line's begin", "write it at the line's begin"
            )
        elif token.letter in block.words:
            what = f"a second {token.letter} in one line"
            raise place.fault(token.column, what, "write one move per line")
        else:
            block.words[token.letter] = token
    return block


def _checked(line: str, place: Place) -> str:
    line_bytes = len(line) if line.isascii() else len(line.encode("utf-8", "surrogatepass"))
    if line_bytes > LONGEST_BYTES:
        what = f"the line has {line_bytes} characters"
        raise place.fault(LONGEST_BYTES + 1, what, f"LinuxCNC reads {LONGEST_BYTES}: write it as two lines")
    line = line.rstrip("\r")
    control = None if line.isprintable() else _CONTROL.search(line)
    if control is not None:
        what = f"the control character U+{ord(control[0]):04X}, which ends a line for some programs and not for others"
        raise place.fault(control.start() + 1, what, "remove it, or end the line with a line feed")
    return line


_ACTIVE = re.compile(
    r"(?:msg|debug|print|log|logopen|logappend|probeopen|abort),|(?:logclose|probeclose)", re.IGNORECASE
)
"""First words of the comments that LinuxCNC executes."""

_PYTHON = re.compile(r"py,|pyrun,|pyreload", re.IGNORECASE)


def _take_comment(block: ProgramBlock, comment: Comment) -> None:
    text = comment.text.lstrip(BLANKS)
    if _PYTHON.match(text):
        what = "a comment that runs Python in the control, which may move it"
        raise block.fault(what, "post the program without it", comment)
    if comment.bracketed and block.message:
        block.comments.append(block.message.rstrip(BLANKS))
        block.message = ""
    if comment.bracketed and _ACTIVE.match(text):
        block.message = text
    else:
        block.comments.append(text.rstrip(BLANKS))


def _take_code(block: ProgramBlock, word: Word) -> None:
    if math.isnan(word.value):
        return  # its parameters are known once it runs
    known = G_CODES if word.letter == "G" else M_CODES
    value = round(word.value, 1)
    group = known.get(value) if abs(value - word.value) < WITHIN else None
    if group is ModalGroup.NOTHING:
        return
    code = name(word.letter, word.value)
    if group is None:
        raise block.fault(f"{code} is not read", remedy(word.letter, word.value), word)
    other = block.codes.get(group) or block.codes.get(EXCLUDED.get(group, group))
    if other is not None:
        what = f"{code} and {name(other.letter, other.value)} exclude each other in one line ({group})"
        raise block.fault(what, "write them in separate lines, or remove one", word)
    block.codes[group] = word._replace(value=value)


WITHIN = 1e-4
"""Largest difference of a computed code from its number."""
