"""LinuxCNC's interpreter `rs274` as a function: what it hands to the motion controller, or that it refuses a program."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tests.nc.planner.required import needs

if TYPE_CHECKING:
    from collections.abc import Mapping

RS274 = shutil.which("rs274")

needs_rs274 = needs("" if RS274 else "LinuxCNC's interpreter rs274 is not installed")

_CALL = re.compile(r"\s*\d+ N(?:\.+|\d+)\s*(?P<name>[A-Z]\w+)\((?P<arguments>.*)\)\s*")

_STATE = {"SELECT_PLANE", "USE_LENGTH_UNITS", "SET_FEED_RATE", "SET_MOTION_CONTROL_MODE"}
"""Calls that change what later calls mean, and are nothing by themselves."""

_MOVES = {"STRAIGHT_TRAVERSE": "RAPID", "STRAIGHT_FEED": "FEED", "ARC_FEED": "ARC"}
_STOPS = {"PROGRAM_STOP": "PAUSE", "OPTIONAL_PROGRAM_STOP": "OPTIONAL_STOP", "DWELL": "DWELL"}
MOTION = frozenset((*_MOVES.values(), *_STOPS.values()))
"""Kinds of events that move the machine or keep it waiting."""

_SILENT = {"COMMENT", "ON_RESET", "SET_XY_ROTATION", "SET_FEED_REFERENCE", "SET_FEED_MODE", "FINISH"}
_SILENT |= {"SET_NAIVECAM_TOLERANCE"}
"""Calls that are no event: they follow from others, or mean nothing to the machine."""

PLANES = ((0, 1), (2, 0), (1, 2))
"""First and second axis of G17, G18, G19."""

_OFFSETS = {"SET_G5X_OFFSET", "SET_G92_OFFSET", "USE_TOOL_LENGTH_OFFSET"}

INCH_MM = 25.4


@dataclass(frozen=True)
class Event:
    """One thing that a program makes the machine do.

    Attributes:
        kind: RAPID, FEED, ARC, DWELL, PAUSE, OPTIONAL_STOP; SAID for messages, spindle, coolant, work systems, the end.
        pose: after it, in machine coordinates, shape (6,) [mm, deg].
        feed: of the tip [mm/min] and of moves that only turn [deg/min].
        centre_mm: of an arc, in the axes of its plane, in machine coordinates.
        turns: of an arc, positive counter-clockwise; 1 for less than a full turn or one.
        plane: of an arc, 0 to 2 as in `PLANES`.
        unit_mm: length unit of the program at this place; printed numbers have four decimals of it [mm].
        corner: path control in force, as printed, lengths in millimetres.
        said: call and arguments of a SAID event, as printed.
    """

    kind: str
    pose: np.ndarray
    feed: tuple[float, float] = (0.0, 0.0)
    centre_mm: tuple[float, float] = (0.0, 0.0)
    turns: int = 0
    plane: int = 0
    dwell_s: float = 0.0
    unit_mm: float = 1.0
    corner: str = ""
    said: str = ""


def printed(
    text: str | bytes, folder: Path, parameters: Mapping[int, float] | None = None, tools: str = "T1 P1 D0.1 Z0\n"
) -> list[tuple[str, str]] | None:
    """Every call with its arguments as printed, and what PRINT writes; None where the program is refused.

    Args:
        parameters: numbered parameters that the control has at the start, lengths in inches.
        tools: its tool table, likewise.
    """
    assert RS274 is not None, "LinuxCNC's interpreter rs274 is not installed: package linuxcnc-uspace"
    (folder / "tool.tbl").write_text(tools)
    stored = sorted((parameters or {}).items())
    (folder / "rs274.var").write_text("".join(f"{number}\t{value:.9f}\n" for number, value in stored))
    (folder / "program.ngc").write_bytes(text if isinstance(text, bytes) else text.encode())
    done = subprocess.run(
        [RS274, "-g", "-t", "tool.tbl", "-v", "rs274.var", "program.ngc"],
        cwd=folder,
        # It keeps its tools in $HOME/.tool.mmap; two that run at once with one such file end with a bus error.
        env=os.environ | {"HOME": str(folder)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=60,
    )
    if done.returncode < 0:
        raise subprocess.CalledProcessError(done.returncode, "rs274", stderr=done.stderr)
    if done.returncode:
        return None
    found = []
    for line in done.stdout.splitlines():
        call = _CALL.fullmatch(line)
        if call is not None:
            found.append((call["name"], call["arguments"]))
        elif line.strip():
            found.append(("PRINT", line))
    return found


def calls(text: str | bytes, folder: Path) -> list[tuple[str, str]] | None:
    """Calls that move, stop, or change feed and units; None where the program is refused."""
    known = {*_MOVES, *_STOPS, "SET_FEED_RATE", "USE_LENGTH_UNITS"}
    made = printed(text, folder)
    return None if made is None else [call for call in made if call[0] in known]


def events(
    text: str | bytes, folder: Path, parameters: Mapping[int, float] | None = None, tools: str = "T1 P1 D0.1 Z0\n"
) -> list[Event] | None:
    """What a program does, in millimetres and degrees; None where it is refused."""
    made = printed(text, folder, parameters, tools)
    if made is None:
        return None
    control = _Control()
    return [event for name, arguments in made if (event := control.event(name, arguments)) is not None]


class _Control:
    """What holds until a call changes it."""

    def __init__(self) -> None:
        self.unit_mm, self.feed, self.pose, self.corner = 1.0, (0.0, 0.0), np.zeros(6), ""
        self.plane = 0
        self.offsets: dict[str, np.ndarray] = {}

    def event(self, name: str, arguments: str) -> Event | None:
        """The event of a call; None where it only changes what holds, or means nothing to the machine."""
        if name in _SILENT:
            return None
        if name in _MOVES:
            return self._move(name, _numbers(arguments))
        if name in _STOPS:
            return Event(_STOPS[name], self.pose, dwell_s=float(arguments or 0.0))
        if name in _OFFSETS:
            numbers = _numbers(arguments.replace(" ", ","))
            system = numbers.pop(0) if name == "SET_G5X_OFFSET" else None
            self.offsets[name] = np.array(numbers[:6]) * ([self.unit_mm] * 3 + [1.0] * 3)
            return None if system is None else Event("SAID", self.pose, said=f"{name}({system:g})")
        if name in _STATE:
            self._set(name, arguments)
            return None
        return Event("SAID", self.pose, said=f"{name}({arguments})")

    def _set(self, name: str, arguments: str) -> None:
        if name == "USE_LENGTH_UNITS":
            self.unit_mm = INCH_MM if "INCHES" in arguments else 1.0
        elif name == "SELECT_PLANE":
            self.plane = {"XY": 0, "XZ": 1, "YZ": 2}[arguments[-2:]]
        elif name == "SET_FEED_RATE":
            self.feed = (float(arguments) * self.unit_mm, float(arguments))
        else:
            mode, _, allowed = arguments.partition(",")
            self.corner = f"{mode} {float(allowed) * self.unit_mm:.4f}" if allowed else mode

    def _move(self, name: str, numbers: list[float]) -> Event:
        unit, centre, turns = self.unit_mm, (0.0, 0.0), 0
        offset = sum(self.offsets.values(), np.zeros(6))
        if name == "ARC_FEED":
            first, second = PLANES[self.plane]
            one, other, i, j, rotation, third, *angles = numbers
            numbers = [0.0] * 3 + angles
            numbers[first], numbers[second], numbers[3 - first - second] = one, other, third
            centre, turns = (i * unit + offset[first], j * unit + offset[second]), int(rotation)
        self.pose = np.array(numbers[:6]) * ([unit] * 3 + [1.0] * 3) + offset
        return Event(_MOVES[name], self.pose, self.feed, centre, turns, self.plane, unit_mm=unit, corner=self.corner)


def _numbers(arguments: str) -> list[float]:
    return [float(number) for number in arguments.split(",") if number.strip()]
