"""LinuxCNC: RS274/NGC as its interpreter has it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.nc.dialect import Dialect, plain
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import DECIMALS_DEG, DECIMALS_MM, Step, rounded

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath

AXES = "XYZABC"
DECIMALS = (DECIMALS_MM,) * 3 + (DECIMALS_DEG,) * 3

MODES = "G21 G90 G94 G17 G40 G49"
"""Millimetres, absolute, feed per minute, arcs in XY, no cutter compensation, no tool length: the model is about the
tool tip. A program must not inherit any of these from the one before it."""

FEED_DIGITS = 7
"""Significant digits of a feed."""

MOST_DECIMALS = 15
"""No feed and no dwell needs more; a line has an end."""


class LinuxCNC(Dialect):
    """Words of an axis are written where they change, the motion code in every line.

    - F under G94 is the speed along X, Y and Z as if A, B and C stood still, which is the feed of the tool tip: it
      needs no correction where the platform tilts on the way.
    - `G64 P Q0`: LinuxCNC starts with corners rounded as far as the feed needs. P bounds that. Exact path (G61) would
      stop at each of 3600 corners. Q0 keeps LinuxCNC from merging short moves, which it does only while A, B and C
      stand still: nominal and compensated programs would run differently.
    - Dwells (G4) end blending: between feed-in and arc the machine stands still at the corner.
    """

    name = "linuxcnc"
    extension = ".ngc"
    what = "LinuxCNC (RS274/NGC)"

    def write(self, toolpath: Toolpath, header: Sequence[str] = ()) -> str:
        """Return the program."""
        # What does not move by the decimals that are written does not move.
        toolpath = replace(toolpath, poses=rounded(toolpath.poses))
        lines = [f"; {plain(text)}".rstrip() for text in header]
        numbers = [f"N{number} " for number in toolpath.numbers] or [""]
        lines.append(numbers[0] + MODES)
        if toolpath.corner_mm is not None:
            lines.append(_path_control(toolpath.corner_mm))
        lines.extend(_body(toolpath))
        lines.append(numbers[-1] + "M2")
        return "\n".join(lines) + "\n"

    def read(self, text: str, name: str, *, start: NDArray[np.float64] | None = None) -> Toolpath:
        """Return what a program commands."""
        return read_program(text, name, start=start)


def _body(toolpath: Toolpath) -> Iterator[str]:
    kinds, words = toolpath.kind.tolist(), _axis_words(toolpath)
    feeds, dwells = toolpath.feed.tolist(), toolpath.dwell_s.tolist()
    last_words: tuple[str, ...] = ("",) * 6
    last_feed = math.nan
    for row, kind in enumerate(kinds):
        if kind in {Step.RAPID, Step.FEED}:
            new = words[row]
            changed = [word for word, old in zip(new, last_words, strict=True) if word != old]
            # A move to where the machine stands already is a move: LinuxCNC wants an axis in it.
            line = ("G0 " if kind == Step.RAPID else "G1 ") + " ".join(changed or new[:1])
            if kind == Step.FEED and feeds[row] != last_feed:
                last_feed = feeds[row]
                line += f" F{digits(last_feed)}"
            last_words = new
            yield line
        elif kind == Step.DWELL:
            yield f"G4 P{digits(dwells[row])}"
        else:
            yield from _said(Step(kind), toolpath.text.get(row, ""))


def _said(kind: Step, text: str) -> Iterator[str]:
    if kind == Step.FUNCTION:
        yield text
    elif kind == Step.COMMENT:
        yield f"; {plain(text)}".rstrip()
    else:
        if text:
            yield f"(MSG, {plain(text).replace('(', '[').replace(')', ']')})"
        yield "M0"


def _axis_words(toolpath: Toolpath) -> list[tuple[str, ...]]:
    """Words of the axes for each row, as text."""
    columns = []
    for letter, decimals, values in zip(AXES, DECIMALS, rounded(toolpath.poses).T.tolist(), strict=True):
        form = f"{letter}%.{decimals}f"
        columns.append([form % value for value in values])
    return list(zip(*columns, strict=True))


def _path_control(corner_mm: float) -> str:
    if corner_mm == 0.0:
        return "G61"
    return "G64" if math.isinf(corner_mm) else f"G64 P{digits(corner_mm)} Q0"


def digits(value: float) -> str:
    """A positive number with seven significant digits and no exponent, which RS274/NGC does not know."""
    if value == 0.0:
        return "0"
    decimals = min(max(0, FEED_DIGITS - 1 - math.floor(math.log10(abs(value)))), MOST_DECIMALS)
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
