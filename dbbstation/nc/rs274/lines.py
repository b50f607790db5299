"""Lines of a program's files, a few thousand of them in memory."""

from __future__ import annotations

from bisect import bisect_right
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.nc.spilled import BLOCK_BYTES, forget

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Integers

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
