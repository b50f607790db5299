"""Long arrays and texts, which lie in a temporary file instead of memory."""

from __future__ import annotations

import codecs
import hashlib
import mmap
import tempfile
import weakref
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.system.handles import reserve

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

IN_MEMORY_BYTES = 4 << 20
"""Size from which an array lies in a file. Programs of 40,000 moves take no more time with half or twice of it."""

BLOCK_BYTES = 1 << 18
"""Bytes that are handled together: of a program, some thousand lines."""

_GROWTH = 1.25
_LEAST = 64


class Spilled:
    """An array that grows at its end. If no file can be made, it stays in memory.

    Args:
        kind: type of an element; may have a shape.
    """

    def __init__(self, kind: Any) -> None:  # noqa: ANN401 - what NumPy takes for a type
        self._kind = np.dtype(kind)
        self._all: NDArray[Any] = np.zeros(_LEAST, self._kind)
        self._count = self._kept = 0
        self._file: Any = None

    def __len__(self) -> int:
        return self._count

    @property
    def values(self) -> NDArray[Any]:
        """Return the values so far."""
        return self._all[: self._count]

    def room(self, more: int) -> NDArray[Any]:
        """Add elements, and return them to be filled."""
        begin, self._count = self._count, self._count + more
        if self._count > len(self._all):
            self._grow(int(_GROWTH * self._count) + 1)
        if (begin - self._kept) * self._kind.itemsize > BLOCK_BYTES:
            self._kept = begin
            forget(self._all)
        return self._all[begin : self._count]

    def add(self, values: NDArray[Any]) -> None:
        """Add elements."""
        self.room(len(values))[:] = values

    def blocks(self) -> Iterator[NDArray[Any]]:
        """Yield successive values."""
        step = BLOCK_BYTES // self._kind.itemsize
        for begin in range(0, self._count, step):
            yield self.values[begin : begin + step]
            forget(self._all)

    def take_back(self) -> None:
        """Remove the last element."""
        self._count -= 1

    def _grow(self, length: int) -> None:
        size = length * self._kind.itemsize
        if size > IN_MEMORY_BYTES:
            with suppress(OSError):
                self._all = self._mapped(length, size)
                return
        grown = np.zeros(length, self._kind)
        grown[: len(self._all)] = self._all
        self._all = grown

    def _mapped(self, length: int, size: int) -> NDArray[Any]:
        file = self._file or tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed with this object
        reserve(file.fileno(), size)  # a full disk shows here, not at a later access
        mapped: NDArray[Any] = np.ndarray(length, self._kind, buffer=mmap.mmap(file.fileno(), size))
        if self._file is None:
            mapped[: len(self._all)] = self._all
            weakref.finalize(self, file.close)
            self._file = file
        return mapped


def forget(values: NDArray[Any]) -> None:
    """Take an array out of memory if a file holds it; what is needed again is read from there."""
    base: Any = values
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap) and hasattr(base, "madvise"):
        base.madvise(mmap.MADV_DONTNEED)


class LongText:
    """A text as UTF-8, perhaps long.

    Attributes:
        first: its begin, which may be known last.
    """

    def __init__(self, blocks: Iterable[bytes] = ()) -> None:
        self.first = b""
        self._letters = Spilled(np.uint8)
        for block in blocks:
            self.add(block)

    @classmethod
    def of(cls, text: str | LongText) -> LongText:
        """Return a text as this class."""
        if isinstance(text, LongText):
            return text
        pieces = (text[begin : begin + BLOCK_BYTES] for begin in range(0, len(text), BLOCK_BYTES))
        return cls(piece.encode("utf-8", "surrogatepass") for piece in pieces)

    def add(self, block: bytes) -> None:
        """Add to the end."""
        self._letters.add(np.frombuffer(block, np.uint8))

    @property
    def sha256(self) -> str:
        """Return the SHA-256."""
        digest = hashlib.sha256()
        for block in self.blocks():
            digest.update(block)
        return digest.hexdigest()

    @property
    def letters(self) -> NDArray[np.uint8]:
        """Return the bytes behind `first`, shape (n,)."""
        return self._letters.values

    def lines(self) -> NDArray[np.uint8]:
        """Return the bytes behind a byte order mark, shape (n,); where a lone CR ends lines, with LF instead."""
        marked = self.letters[: len(codecs.BOM_UTF8)].tobytes() == codecs.BOM_UTF8
        letters = self.letters[len(codecs.BOM_UTF8) * marked :]
        for block in self.blocks():
            if b"\n" in block:
                return letters
        return np.where(letters == ord("\r"), np.uint8(ord("\n")), letters)

    def blocks(self) -> Iterator[bytes]:
        """Yield the bytes of the text."""
        yield self.first
        for block in self._letters.blocks():
            yield block.tobytes()

    def __str__(self) -> str:
        return b"".join(self.blocks()).decode("utf-8", "surrogatepass")
