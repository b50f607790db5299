"""G and M codes that the reader accepts, their modal groups, and reasons to refuse others."""

from __future__ import annotations

from enum import StrEnum

from dbbstation.nc.toolpath import SYSTEMS


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


def remedy_of_letter(letter: str) -> str:
    """Return the remedy for an unsupported letter."""
    return (
        "the model has no such axis: post the program without it" if letter in "UVW" else "post the program without it"
    )


def name(letter: str, value: float) -> str:
    """Return a code as people write it: G1, G91.1."""
    return f"{letter}{value:.10g}"


def remedy(letter: str, value: float) -> str:
    """Return the remedy for an unsupported code."""
    return "post the program without it" if letter == "M" else _REMEDIES.get(value, "post the program without it")
