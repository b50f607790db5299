"""Read, change and lock files in place, through a file descriptor."""

from __future__ import annotations

import errno
import os
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Self

try:
    import fcntl
except ImportError:  # Windows
    HAS_FLOCK = False
else:
    HAS_FLOCK = True

if TYPE_CHECKING:
    from pathlib import Path


class Closing(ABC):
    """Base of what a `with` block closes."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Close it."""


def _flags(*names: str) -> int:
    return sum(getattr(os, name, 0) for name in ("O_BINARY", "O_CLOEXEC", *names))


# Opening must neither wait for the writer of a pipe nor take a terminal that interrupts the program.
_READING = os.O_RDONLY | _flags("O_NONBLOCK", "O_NOCTTY")
_CHANGING = os.O_RDWR | _flags("O_NOFOLLOW")


def open_to_read(path: Path) -> int:
    """Open a file for reading and return its descriptor.

    Raises:
        OSError: the system refuses it.
    """
    return os.open(path, _READING)


def may_write(folder: Path) -> bool:
    """Return whether the system seems to let this user make files in a folder."""
    return os.access(folder, os.W_OK)


def open_private(path: str, flags: int) -> int:
    """Open a file as `open` does; a new one is readable by its owner only."""
    return os.open(path, flags | _flags(), 0o600)


def open_to_change(path: Path, *, create: bool = False, private: bool = False) -> int:
    """Open a file for reading and writing and return its descriptor; a link is refused.

    Args:
        private: only its owner may read a file that is made.

    Raises:
        OSError: the system refuses it, or it is a link.
    """
    if not hasattr(os, "O_NOFOLLOW") and path.is_symlink():
        raise OSError(errno.ELOOP, "this is a link", str(path))
    return os.open(path, _CHANGING | (os.O_CREAT if create else 0), 0o600 if private else 0o666)


def read_at(handle: int, count: int, at: int) -> bytes:
    """Return at most `count` bytes from byte `at` on; fewer at the end of the file."""
    os.lseek(handle, at, os.SEEK_SET)
    pieces = []
    while count > 0 and (piece := os.read(handle, count)):
        pieces.append(piece)
        count -= len(piece)
    return b"".join(pieces)


def write_at(handle: int, data: bytes, at: int) -> None:
    """Write all bytes from byte `at` on.

    Raises:
        OSError: the disk refuses; some of them may be written.
    """
    os.lseek(handle, at, os.SEEK_SET)
    left = memoryview(data)
    while left:
        left = left[os.write(handle, left) :]


def reserve(handle: int, size: int) -> None:
    """Make a file `size` bytes long, where the system can with all its place on the disk.

    Raises:
        OSError: the disk is full, or the file cannot be as long.
    """
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(handle, 0, size)
    os.truncate(handle, size)


def open_nothing() -> int:
    """Return a descriptor of the null device, open for reading and writing; it has the lowest free number."""
    return os.open(os.devnull, os.O_RDWR)


_BEYOND = 1 << 30
"""Offset of the byte that Windows locks. Other processes cannot read a locked byte, so it is beyond the file's
content."""

_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS}


def lock(handle: int) -> bool:
    """Lock an open file; return False if its file system has no locks.

    POSIX: flock(2). Windows: `_locking` with LK_NBLCK, Microsoft C Runtime Reference, "_locking"; it may lock bytes
    behind the end.

    Raises:
        BlockingIOError: another process has locked it.
        OSError: the system refuses for another reason.
    """
    try:
        if HAS_FLOCK:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            _lock_byte(handle)
    except BlockingIOError:
        raise
    except OSError as error:
        if error.errno in _NO_LOCKS:
            return False
        raise
    return True


def _lock_byte(handle: int) -> None:
    import msvcrt  # noqa: PLC0415 - exists on Windows alone

    os.lseek(handle, _BEYOND, os.SEEK_SET)
    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]  # Windows alone has it
    except PermissionError as error:
        raise BlockingIOError(errno.EAGAIN, "another process has locked it") from error
