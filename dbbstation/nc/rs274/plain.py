"""Read many plain lines at once: lines with axes, G0, G1, F and N only. Most lines of CAM systems are plain."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.machine.compiled import compiled, inlined

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats, Integers

LEAST_LINES, MOST_LINES = 4, 5_000
"""Least and greatest number of lines that are read at once. Fewer lines are read faster one by one; more lines need arrays
that short programs do not fill."""

MOST_DIGITS = 15
"""A number with more digits is read separately: floating point cannot hold its digits exactly."""

MOST_WHOLE = 8
"""Greatest number of digits of a line number or F; longer ones are read separately."""

_LETTERS = np.frombuffer(b"XYZABCF", dtype=np.uint8)
_F = 6

_BLANK, _PLUS, _MINUS, _POINT, _ZERO, _ONE, _NINE, _G, _N = b" +-.019GN"
_LF, _CR = b"\n\r"


class PlainLines(NamedTuple):
    """The content of successive lines, one row each.

    Attributes:
        numbers: line number, -1 if there is none, shape (n,).
        motion: 0 or 1, NaN if not said, shape (n,).
        feed: F, NaN if not said, shape (n,).
        axes: X, Y, Z, A, B, C as written, NaN if not named, shape (n, 6).
    """

    numbers: Integers
    motion: Floats
    feed: Floats
    axes: Floats


def plain_lines(letters: NDArray[np.uint8], at: int) -> PlainLines:
    """Return the content of plain lines from a position up to the first line that is not plain; a zero byte ends the letters."""
    for most in (LEAST_LINES, MOST_LINES):
        head, digits = np.full((most, 2), -1, dtype=np.int64), np.zeros((most, 7), dtype=np.int64)
        decimals = np.full((most, 7), -1, dtype=np.int64)
        count = _read(letters, at, head, digits, decimals, _LETTERS)
        if count < most:
            break
    decimals = decimals[:count]
    said = np.where(decimals < 0, np.nan, digits[:count] / 10.0 ** np.abs(decimals))
    motion = np.where(head[:count, 1] < 0, np.nan, head[:count, 1])
    return PlainLines(head[:count, 0], motion, said[:, _F], said[:, :_F])


@compiled
def _read(
    letters: NDArray[np.uint8],
    at: int,
    head: Integers,
    digits: Integers,
    decimals: Integers,
    names: NDArray[np.uint8],
) -> int:
    for row in range(len(head)):
        at = _after_number(letters, at, head[row])
        at = _after_motion(letters, at, head[row]) if at >= 0 else -1
        at = _after_axes(letters, at, digits[row], decimals[row], names) if at >= 0 else -1
        if at < 0:
            return row
    return len(head)


@inlined
def _after_number(letters: NDArray[np.uint8], at: int, head: Integers) -> int:
    if letters[at] != _N:
        return at
    end, head[0], places = _number(letters, at + 1)
    if end < 0 or places > 0 or letters[at + 1] < _ZERO or letters[end - 1] == _POINT:
        return -1
    return end + (letters[end] == _BLANK)


@inlined
def _after_motion(letters: NDArray[np.uint8], at: int, head: Integers) -> int:
    if letters[at] != _G:
        return at
    at += 1 + (letters[at + 1] == _ZERO and _ZERO <= letters[at + 2] <= _ONE)
    if not _ZERO <= letters[at] <= _ONE or _ZERO <= letters[at + 1] <= _NINE or letters[at + 1] == _POINT:
        return -1
    head[1] = letters[at] - _ZERO
    return at + 1 + (letters[at + 1] == _BLANK)


@inlined
def _after_axes(
    letters: NDArray[np.uint8],
    at: int,
    digits: Integers,
    decimals: Integers,
    names: NDArray[np.uint8],
) -> int:
    first = at
    for name in range(7):
        if letters[at] == names[name] and (name < _F or (at > first and _ZERO <= letters[at + 1] <= _NINE)):
            end, digits[name], decimals[name] = _number(letters, at + 1)
            if end < 0:
                return -1
            at = end + (letters[end] == _BLANK)
    end = at + (letters[at] == _CR)
    return end + 1 if at > first and letters[end] == _LF else -1


@inlined
def _number(letters: NDArray[np.uint8], at: int) -> tuple[int, int, int]:
    """Return the end of a number, its digits and its decimals; -1 if there is no number."""
    sign = -1 if letters[at] == _MINUS else 1
    at += letters[at] == _MINUS or letters[at] == _PLUS
    value, count, places, behind = 0, 0, 0, False
    while _ZERO <= letters[at] <= _NINE or (letters[at] == _POINT and not behind):
        if letters[at] == _POINT:
            behind = True
        else:
            value, count, places = 10 * value + (letters[at] - _ZERO), count + 1, places + behind
            if count > MOST_DIGITS or count - places > MOST_WHOLE:
                return -1, 0, 0
        at += 1
    return (at, sign * value, places) if count else (-1, 0, 0)
