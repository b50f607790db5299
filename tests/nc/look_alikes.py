"""Programs as people and their CAM write them, drawn from a seed: parts that a control runs for some seconds.

Nothing in them is from anybody's program. They look like what posts for LinuxCNC write: headers of codes, rapids up, over and
down, pockets, facing, contours with arcs, holes in single moves, surfaces in short lines, five axes at once, path control with and
without a bound, with none at all.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

HEADERS = ("G21 G90 G94", "G17 G21 G40 G49 G54 G80 G90 G94", "G90 G94 G17 G91.1\nG21", "G21\nG90")
PATH_CONTROL = ("", "G64", "G64 P0.01", "G64 P0.05", "G64 P0.1", "G64 P0.02 Q0.01", "G61")
CLEAR_MM, ABOVE_MM = 20.0, 2.0


def look_alike(seed: int) -> str:
    drawn = np.random.default_rng(seed)
    style = STYLES[seed % len(STYLES)]
    control = str(drawn.choice(PATH_CONTROL))
    x, y, a, b = drawn.uniform(-60.0, 60.0, 2).tolist() + drawn.uniform(-5.0, 5.0, 2).tolist()
    feed = float(drawn.choice([200, 400, 800, 1200, 2000, 3000, 5000]))
    lines = [f"({style.__name__.strip('_')} {seed})", str(drawn.choice(HEADERS)), control]
    lines += ["S8000 M3" if drawn.random() < 0.5 else "", "M8" if drawn.random() < 0.3 else ""]
    lines.append(f"G0 X{x:.3f} Y{y:.3f} Z{CLEAR_MM - 1000.0:.3f} A{a:.3f} B{b:.3f} C0")
    lines += style(drawn, x, y, feed)
    lines += [f"G0 Z{CLEAR_MM - 1000.0:.3f}", "M9", "M5", str(drawn.choice(["M2", "M30"]))]
    return "\n".join(line for line in lines if line) + "\n"


def _down(depth_mm: float, feed: float) -> list[str]:
    return [f"G0 Z{ABOVE_MM - 1000.0:.3f}", f"G1 Z{-1000.0 - depth_mm:.3f} F{feed / 2:g}"]


def _pocket(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    step, wide, long = drawn.uniform(2.0, 6.0), *drawn.uniform(0.5, 1.5, 2)
    yield from _down(1.5, feed)
    for turn in range(1, 4):
        dx, dy = turn * step * wide, turn * step * long
        yield f"G1 X{x - dx:.3f} Y{y - dy:.3f} F{feed:g}"
        for sx, sy in ((1, -1), (1, 1), (-1, 1), (-1, -1)):
            yield f"X{x + sx * dx:.3f} Y{y + sy * dy:.3f}"


def _facing(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    wide, step, lifted = drawn.uniform(10.0, 40.0), drawn.uniform(1.0, 4.0), drawn.random() < 0.5
    yield from _down(0.5, feed)
    for line in range(5):
        yield f"G1 X{x + (wide if line % 2 == 0 else 0.0):.3f} F{feed:g}"
        if lifted:
            yield f"G0 Z{ABOVE_MM - 1000.0:.3f}"
            yield f"Y{y + (line + 1) * step:.3f}"
            yield f"G1 Z-1000.5 F{feed / 2:g}"
        else:
            yield f"Y{y + (line + 1) * step:.3f}"


def _contour(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    wide, high, radius = drawn.uniform(20.0, 40.0), drawn.uniform(15.0, 30.0), drawn.uniform(0.5, 6.0)
    yield from _down(2.0, feed)
    yield f"G3 X{x + 3:.3f} Y{y - 3:.3f} I3 J0 F{feed:g}"
    yield f"G1 X{x + wide:.3f}"
    yield f"G3 X{x + wide + radius:.3f} Y{y - 3 + radius:.3f} I0 J{radius:.3f}"
    yield f"G1 Y{y + high:.3f}"
    yield f"G3 X{x + wide:.3f} Y{y + high + radius:.3f} I{-radius:.3f} J0"
    yield f"G1 X{x + 3:.3f}"
    yield f"G3 X{x + 3 - radius:.3f} Y{y + high:.3f} I0 J{-radius:.3f}"
    yield f"G1 Y{y:.3f}"


def _holes(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    dwell, pecks = drawn.random() < 0.3, int(drawn.integers(1, 4))
    for hole in range(4):
        yield f"G0 X{x + 12.0 * (hole % 2):.3f} Y{y + 15.0 * (hole // 2):.3f}"
        for peck in range(1, pecks + 1):
            yield from _down(2.0 * peck, feed)
            if dwell:
                yield "G4 P0.1"
            yield f"G0 Z{ABOVE_MM - 1000.0:.3f}"
        yield f"Z{CLEAR_MM - 1000.0:.3f}"


def _surface(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    """Waves in short lines, as CAM writes surfaces, with points where they bend."""
    high, waves, step = drawn.uniform(0.2, 3.0), drawn.uniform(1.0, 3.0), drawn.uniform(0.1, 0.8)
    yield from _down(1.0, feed)
    yield f"F{feed:g}"
    for line in range(2):
        along = np.arange(0.0, 25.0, step)
        for place in along if line == 0 else along[::-1]:
            z = -1001.0 + high * math.sin(2.0 * math.pi * waves * place / 25.0)
            yield f"G1 X{x + place:.3f} Y{y + line:.3f} Z{z:.3f}"


def _five(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    tilt, step = drawn.uniform(1.0, 6.0), drawn.uniform(0.5, 4.0)
    yield from _down(1.0, feed)
    for place in np.arange(0.0, 40.0, step):
        turn = place / 40.0 * math.pi
        yield (
            f"G1 X{x + place:.3f} Y{y + 10 * math.sin(turn):.3f} A{tilt * math.sin(turn):.4f} "
            f"B{tilt * math.cos(turn):.4f} F{feed:g}"
        )


def _ramp(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    radius, pitch = drawn.uniform(3.0, 12.0), drawn.uniform(0.3, 1.0)
    yield f"G0 Z{ABOVE_MM - 1000.0:.3f}"
    yield f"F{feed:g}"
    for turn in range(3):
        yield f"G2 X{x:.3f} Y{y:.3f} Z{-1000.0 - pitch * turn:.3f} I{radius:.3f} J0"
    yield f"G2 X{x:.3f} Y{y:.3f} I{radius:.3f} J0"


def _letters(drawn: np.random.Generator, x: float, y: float, feed: float) -> Iterator[str]:
    for letter in range(4):
        at = np.array([x + 6.0 * letter, y])
        yield f"G0 X{at[0]:.3f} Y{at[1]:.3f}"
        yield from _down(0.2, feed)
        for _ in range(int(drawn.integers(2, 6))):
            at = at + drawn.uniform(-5.0, 5.0, 2)
            yield f"G1 X{at[0]:.3f} Y{at[1]:.3f} F{feed:g}"
        yield f"G0 Z{ABOVE_MM - 1000.0:.3f}"


STYLES = (_pocket, _facing, _contour, _holes, _surface, _five, _ramp, _letters)
