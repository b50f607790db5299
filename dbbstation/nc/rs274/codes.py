"""G and M codes that the reader knows, their modal groups, and reasons to refuse others."""

from __future__ import annotations

from enum import StrEnum

from dbbstation.nc.toolpath import SYSTEMS


class ModalGroup(StrEnum):
    """Codes of one group exclude each other in a line."""

    MOTION = "motion"
    ONCE = "not modal"
    PLANE = "plane"
    UNITS = "units"
    DISTANCE = "distance"
    ARC_DISTANCE = "arc distance"
    FEED_MODE = "feed mode"
    CUTTER = "cutter compensation"
    TOOL_LENGTH = "tool length"
    CYCLE = "cycle"
    OFFSET = "work offset"
    PATH = "path control"
    STOP = "stop"
    SPINDLE = "spindle"
    COOLANT = "coolant"


G_CODES: dict[float, ModalGroup] = {
    0: ModalGroup.MOTION,
    1: ModalGroup.MOTION,
    2: ModalGroup.MOTION,
    3: ModalGroup.MOTION,
    4: ModalGroup.ONCE,
    17: ModalGroup.PLANE,
    20: ModalGroup.UNITS,
    21: ModalGroup.UNITS,
    40: ModalGroup.CUTTER,
    49: ModalGroup.TOOL_LENGTH,
    53: ModalGroup.ONCE,
    **{float(name[1:]): ModalGroup.OFFSET for name in SYSTEMS},
    61: ModalGroup.PATH,
    64: ModalGroup.PATH,
    80: ModalGroup.CYCLE,
    90: ModalGroup.DISTANCE,
    91: ModalGroup.DISTANCE,
    90.1: ModalGroup.ARC_DISTANCE,
    91.1: ModalGroup.ARC_DISTANCE,
    94: ModalGroup.FEED_MODE,
}

M_CODES: dict[float, ModalGroup] = {
    0: ModalGroup.STOP,
    1: ModalGroup.STOP,
    2: ModalGroup.STOP,
    30: ModalGroup.STOP,
    3: ModalGroup.SPINDLE,
    4: ModalGroup.SPINDLE,
    5: ModalGroup.SPINDLE,
    7: ModalGroup.COOLANT,
    8: ModalGroup.COOLANT,
    9: ModalGroup.COOLANT,
}

LETTERS = frozenset("ABCFGIJMNPQRSXYZ")

_OTHER_COORDINATES = "the model holds in machine coordinates: post the program without commands that set offsets"
_TOOL = "the model is about one tool tip: post the program for the tool tip, without compensation in the control"
_REMEDIES: dict[float, str] = {
    **dict.fromkeys((18, 19), "only arcs in the XY plane (G17) are read"),
    **dict.fromkeys((41, 41.1, 42, 42.1, 43, 43.1, 43.2, 43.4, 43.5), _TOOL),
    **dict.fromkeys((5, 5.1, 5.2, 5.3, 6.2), "post curves as lines or arcs"),
    **dict.fromkeys((33, 33.1, 32), "motion that follows the spindle has no path in time: run it without compensation"),
    **dict.fromkeys(
        (38.2, 38.3, 38.4, 38.5, 31), "where probing ends is not known before: run it without compensation"
    ),
    **dict.fromkeys((10, 52, 92, 92.1, 92.2, 92.3), _OTHER_COORDINATES),
    **dict.fromkeys((93, 95), "post the program with feed per minute (G94)"),
    **dict.fromkeys((73, 74, 76, 81, 82, 83, 84, 85, 86, 87, 88, 89), "post cycles as single moves"),
    **dict.fromkeys((28, 28.1, 30, 30.1), "name the pose instead"),
}


_LETTERS_NOT_READ = {
    "O": "write subroutines, conditions and loops out as single moves, and remove program numbers",
    "T": "post one program for each tool, for its tip, without tool changes",
    "K": "only arcs in the XY plane (G17), with I and J, are read",
}


def remedy_of_letter(letter: str) -> str:
    """Return what to do about a letter that is not read."""
    return _LETTERS_NOT_READ.get(letter, "post the program without it")


def name(letter: str, value: float) -> str:
    """Return a code as people write it: G1, G91.1."""
    return f"{letter}{value:.10g}"


def remedy(letter: str, value: float) -> str:
    """Return what to do about a code that is not read."""
    if letter == "M" and value in {98, 99}:
        return _LETTERS_NOT_READ["O"]
    if letter == "M":
        return "post the program without it" + (" and without tool changes" if value == 6 else "")  # noqa: PLR2004
    return _REMEDIES.get(value, "post the program without it")
