"""Lines of a program's files, a few thousand of them in memory, and many plain lines read at once.

Plain lines have axes, G0, G1, F and N only. Most lines of CAM systems are plain.
"""

from __future__ import annotations

from bisect import bisect_right
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.nc.spilled import BLOCK_BYTES, forget

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers


LF = ord("\n")

STRETCHES = 16
"""Number of stretches in memory: a loop calls subprograms that lie in some of them without reading them again."""


class _Stretch(NamedTuple):
    """Successive lines.

    Attributes:
        first: index of the first line.
        data: the lines with their ends, and a zero byte.
        begins: of each line in `data`, and the end of the last one.
    """

    first: int
    data: bytes
    begins: Integers


class ProgramLines:
    """Lines by index, from 0; the lines of files that are appended follow."""

    def __init__(self) -> None:
        self._places: list[tuple[NDArray[np.uint8], int, int, bytes]] = []
        self._firsts: list[int] = []
        self._count = 0
        self._read = lru_cache(STRETCHES)(self._of_place)
        self._last = _Stretch(0, b"", np.zeros(1, np.int64))

    def __len__(self) -> int:
        return self._count

    def append(self, letters: NDArray[np.uint8], wanted: Flags) -> Iterator[tuple[int, str]]:
        """Append a file as UTF-8, shape (n,); yield lines that have one of the wanted bytes, with their indices."""
        begin = 0
        while begin <= len(letters):
            end = begin + BLOCK_BYTES
            while end < len(letters) and not (letters[begin:end] == LF).any():
                end += BLOCK_BYTES
            block = letters[begin:end]
            ends = np.flatnonzero(block == LF)
            is_last = end >= len(letters)
            if not is_last:
                block = block[: ends[-1] + 1]
            self._places.append((letters, begin, begin + len(block), b"\n" if is_last else b""))
            self._firsts.append(self._count)
            self._count += len(ends) + is_last
            for at in np.unique(np.searchsorted(ends, np.flatnonzero(wanted[block]))).tolist():
                yield self._firsts[-1] + at, self[self._firsts[-1] + at]
            forget(letters)
            begin = len(letters) + 1 if is_last else begin + len(block)

    def __getitem__(self, at: int) -> str:
        stretch = self._stretch(at)
        begin, end = stretch.begins[at - stretch.first], stretch.begins[at - stretch.first + 1] - 1
        return stretch.data[begin:end].decode("utf-8", "surrogatepass")

    def letters_from(self, at: int) -> tuple[NDArray[np.uint8], int]:
        """Return bytes of lines, and the begin of a line in them; a zero byte ends them."""
        stretch = self._stretch(at)
        return np.frombuffer(stretch.data, np.uint8), int(stretch.begins[at - stretch.first])

    def _stretch(self, at: int) -> _Stretch:
        if not 0 <= at - self._last.first < len(self._last.begins) - 1:
            self._last = self._read(bisect_right(self._firsts, at) - 1)
        return self._last

    def _of_place(self, place: int) -> _Stretch:
        letters, begin, end, after = self._places[place]
        data = letters[begin:end].tobytes() + after
        forget(letters)
        begins = np.flatnonzero(np.frombuffer(data, np.uint8) == LF) + 1
        return _Stretch(self._firsts[place], data + b"\0", np.concatenate([[0], begins]))


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
        count = _read(letters, at, head, digits, decimals)
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
) -> int:
    for row in range(len(head)):
        at = _after_number(letters, at, head[row])
        at = _after_motion(letters, at, head[row]) if at >= 0 else -1
        at = _after_axes(letters, at, digits[row], decimals[row]) if at >= 0 else -1
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
) -> int:
    first = at
    for name in range(7):
        if letters[at] == _LETTERS[name] and (name < _F or (at > first and _ZERO <= letters[at + 1] <= _NINE)):
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
