"""G and M codes that the reader knows, their modal groups, and why it refuses others."""

from __future__ import annotations

from enum import StrEnum

from dbbstation.nc.toolpath import SYSTEMS


class Group(StrEnum):
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


G_CODES: dict[float, Group] = {
    0: Group.MOTION,
    1: Group.MOTION,
    2: Group.MOTION,
    3: Group.MOTION,
    4: Group.ONCE,
    17: Group.PLANE,
    20: Group.UNITS,
    21: Group.UNITS,
    40: Group.CUTTER,
    49: Group.TOOL_LENGTH,
    53: Group.ONCE,
    **{float(name[1:]): Group.OFFSET for name in SYSTEMS},
    61: Group.PATH,
    64: Group.PATH,
    80: Group.CYCLE,
    90: Group.DISTANCE,
    91: Group.DISTANCE,
    90.1: Group.ARC_DISTANCE,
    91.1: Group.ARC_DISTANCE,
    94: Group.FEED_MODE,
}

M_CODES: dict[float, Group] = {
    0: Group.STOP,
    1: Group.STOP,
    2: Group.STOP,
    30: Group.STOP,
    3: Group.SPINDLE,
    4: Group.SPINDLE,
    5: Group.SPINDLE,
    7: Group.COOLANT,
    8: Group.COOLANT,
    9: Group.COOLANT,
}

LETTERS = frozenset("ABCFGIJMNPQRSXYZ")

_OTHER_COORDINATES = "the model holds in machine coordinates: post the program without commands that set offsets"
_TOOL = "the model is about one tool tip: post the program for the tool tip, without compensation in the control"
_REMEDIES: dict[float, str] = {
    **dict.fromkeys((18, 19), "only arcs in the XY plane (G17) are read"),
    **dict.fromkeys((41, 41.1, 42, 42.1, 43, 43.1, 43.2), _TOOL),
    **dict.fromkeys((10, 52, 92, 92.1, 92.2, 92.3), _OTHER_COORDINATES),
    **dict.fromkeys((93, 95), "post the program with feed per minute (G94)"),
    **dict.fromkeys((73, 74, 76, 81, 82, 83, 84, 85, 86, 87, 88, 89), "post cycles as single moves"),
    **dict.fromkeys((28, 28.1, 30, 30.1), "name the pose instead"),
}


def name(letter: str, value: float) -> str:
    """Return a code as people write it: G1, G91.1."""
    return f"{letter}{value:.10g}"


def remedy(letter: str, value: float) -> str:
    """What to do about a code that is not read."""
    if letter == "M":
        return "post the program without it" + (" and without tool changes" if value == 6 else "")  # noqa: PLR2004
    return _REMEDIES.get(value, "post the program without it")
