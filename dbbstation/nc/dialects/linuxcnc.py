"""LinuxCNC: RS274/NGC as its interpreter has it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.dialect import Dialect, plain
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import DECIMALS_DEG, DECIMALS_MM, Step, rounded

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

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
    kinds, words = toolpath.kind.tolist(), _changed_words(toolpath)
    feeds, dwells = toolpath.feed.tolist(), toolpath.dwell_s.tolist()
    last_feed = math.nan
    for row, kind in enumerate(kinds):
        if kind == Step.RAPID:
            yield f"G0 {words[row]}"
        elif kind == Step.FEED:
            feed = "" if feeds[row] == last_feed else f" F{digits(feeds[row])}"
            last_feed = feeds[row]
            yield f"G1 {words[row]}{feed}"
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


def _changed_words(toolpath: Toolpath) -> list[str]:
    """Words of the axes that each move changes, as text; nothing for rows that are no moves.

    Moves that change the same axes are written together, by one form.
    """
    texts = [""] * len(toolpath)
    moves = np.flatnonzero(toolpath.is_move)
    poses = toolpath.poses[moves]
    changed = np.ones(poses.shape, dtype=np.bool_)
    changed[1:] = poses[1:] != poses[:-1]
    # A move to where the machine stands already is a move: LinuxCNC wants an axis in it.
    changed[~changed.any(axis=1), 0] = True
    which = changed @ (1 << np.arange(len(AXES)))
    for one in np.unique(which):
        alike = np.flatnonzero(which == one)
        axes = np.flatnonzero(changed[alike[0]])
        form = " ".join(f"{AXES[axis]}%.{DECIMALS[axis]}f" for axis in axes)
        for row, values in zip(moves[alike].tolist(), poses[np.ix_(alike, axes)].tolist(), strict=True):
            texts[row] = form % tuple(values)
    return texts


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
