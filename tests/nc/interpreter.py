"""LinuxCNC's interpreter `rs274` as a function: what it hands to the motion controller, or that it refuses a program."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

RS274 = shutil.which("rs274")

_CALL = re.compile(
    r"(STRAIGHT_TRAVERSE|STRAIGHT_FEED|ARC_FEED|DWELL|PROGRAM_STOP|OPTIONAL_PROGRAM_STOP|SET_FEED_RATE|USE_LENGTH_UNITS)"
    r"\(([^)]*)\)"
)


@dataclass(frozen=True)
class Event:
    """One thing that a program makes the machine do.

    Attributes:
        kind: RAPID, FEED, ARC, DWELL or PAUSE.
        pose: after it, shape (6,) [mm, deg].
        feed: of the tip [mm/min] and of moves that only turn [deg/min].
        centre_mm: of an arc, X and Y [mm].
        turns: of an arc, positive counter-clockwise; 1 for less than a full turn or one.
        dwell_s: of a dwell [s].
        unit_mm: length unit of the program at this place; printed numbers have four decimals of it [mm].
    """

    kind: str
    pose: np.ndarray
    feed: tuple[float, float] = (0.0, 0.0)
    centre_mm: tuple[float, float] = (0.0, 0.0)
    turns: int = 0
    dwell_s: float = 0.0
    unit_mm: float = 1.0


def calls(text: str | bytes, folder: Path) -> list[tuple[str, str]] | None:
    """Calls with their arguments as printed; None where the program is refused."""
    (folder / "tool.tbl").write_text("T1 P1 D0.1 Z0\n")
    (folder / "rs274.var").write_text("")
    (folder / "program.ngc").write_bytes(text if isinstance(text, bytes) else text.encode())
    done = subprocess.run(
        [str(RS274), "-g", "-t", "tool.tbl", "-v", "rs274.var", "program.ngc"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=60,
    )
    return None if done.returncode else _CALL.findall(done.stdout)


def events(text: str | bytes, folder: Path) -> list[Event] | None:
    """What a program does, in millimetres and degrees; None where it is refused."""
    made = calls(text, folder)
    if made is None:
        return None
    unit, feed, pose = 1.0, (0.0, 0.0), np.zeros(6)
    found: list[Event] = []
    for name, printed in made:
        if name == "USE_LENGTH_UNITS":
            unit = 25.4 if "INCHES" in printed else 1.0
            continue
        numbers = np.array([float(number) for number in printed.split(",") if number.strip()])
        if name == "SET_FEED_RATE":
            feed = (float(numbers[0]) * unit, float(numbers[0]))
        elif name.startswith("STRAIGHT"):
            pose = np.concatenate([numbers[:3] * unit, numbers[3:]])
            found.append(Event("RAPID" if name.endswith("TRAVERSE") else "FEED", pose, feed, unit_mm=unit))
        elif name == "ARC_FEED":
            x, y, i, j, turns, z, *angles = numbers
            pose = np.array([x * unit, y * unit, z * unit, *angles])
            found.append(Event("ARC", pose, feed, (i * unit, j * unit), int(turns), unit_mm=unit))
        elif name == "DWELL":
            found.append(Event("DWELL", pose, dwell_s=float(numbers[0])))
        else:
            found.append(Event("PAUSE", pose))
    return found
