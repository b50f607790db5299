"""The program's only reader of files: it reads regular files only, up to a size limit.

A pipe blocks, a device never ends, and a file may grow. `tests/files/test_gateway.py` finds code that reads elsewhere.
A refusal is an `OSError` with its reason as `strerror`.
"""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.system.handles import open_to_read

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from io import FileIO
    from pathlib import Path

LARGEST_BYTES = 2_000_000_000
"""Largest file that is read [bytes], about an hour at a hundred thousand readings a second."""

BLOCK_BYTES = 1 << 20
"""Bytes that are read at once: a thousandth of the largest file, which needs little memory."""


class NotRegularError(OSError):
    """The path names a pipe, a socket or a device, not a regular file."""


class TooLargeError(OSError):
    """A file exceeds the size limit."""


class Source:
    """An open regular file."""

    def __init__(self, file: FileIO, path: Path, size: int, largest: int) -> None:
        self._file = file
        self._path = path
        self._size = size
        self._left = largest
        self._largest = largest

    def read(self, most: int = BLOCK_BYTES) -> bytes:
        """Return at most `most` bytes; empty at the end.

        Raises:
            TooLargeError: it exceeds the largest size.
            OSError: it cannot be read.
        """
        data = self._file.read(min(most, self._left + 1))
        self._left -= len(data)
        if self._left < 0:
            raise TooLargeError(errno.EFBIG, f"the file is longer than {self._largest:,} bytes", str(self._path))
        return data

    def blocks(self) -> Iterator[bytes]:
        """Yield the file in blocks."""
        while data := self.read():
            yield data

    def content(self) -> bytes:
        """Return the whole file."""
        # The whole at once, without a second copy: it grows on only where it grew since it was opened.
        first = self.read(self._size + 1)
        rest = list(self.blocks())
        return b"".join([first, *rest]) if rest else first


@contextmanager
def opened(path: Path, largest: int = LARGEST_BYTES) -> Iterator[Source]:
    """Open a regular file for reading.

    Raises:
        NotRegularError: it is a pipe, a socket or a device.
        TooLargeError: it exceeds the size limit.
        OSError: it is missing, a folder, or refused by the system.
    """
    _check(path, _stat(path), largest)  # some devices do something when they are opened
    with os.fdopen(open_to_read(path), "rb", buffering=0) as file:
        found = os.fstat(file.fileno())  # it may be another one by now
        _check(path, found, largest)
        yield Source(file, path, found.st_size, largest)


def content_of(path: Path, largest: int = LARGEST_BYTES) -> bytes:
    """Return a file's bytes."""
    with opened(path, largest) as source:
        return source.content()


def head_of(path: Path, most: int) -> bytes:
    """Return at most the first `most` bytes of a file."""
    with opened(path) as source:
        return source.read(most)


def sha256_hex(data: bytes | str) -> str:
    """Return the SHA-256 of bytes, or of a text in UTF-8."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()


def sha256_of_blocks(blocks: Iterable[bytes]) -> str:
    """Return the SHA-256 of a text that comes in blocks."""
    digest = hashlib.sha256()
    for block in blocks:
        digest.update(block)
    return digest.hexdigest()


def digest_of(path: Path) -> str:
    """Return a file's SHA-256 in hexadecimal, read in blocks."""
    with opened(path) as source:
        return sha256_of_blocks(source.blocks())


def _stat(path: Path) -> os.stat_result:
    try:
        return path.stat()
    except ValueError as error:  # a name that no file can have: with a zero byte or half a surrogate pair
        raise FileNotFoundError(errno.ENOENT, "there is no such file", str(path)) from error


def _check(path: Path, found: os.stat_result, largest: int) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "this is a folder: name a file", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise NotRegularError(errno.EINVAL, "this is a pipe or a device: name a file", str(path))
    if found.st_size > largest:
        what = f"the file has {found.st_size:,} bytes, at most {largest:,} are read"
        raise TooLargeError(errno.EFBIG, what, str(path))
