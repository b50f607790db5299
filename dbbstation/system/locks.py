"""A lock on a file for one process; the system releases it at the process's end."""

from __future__ import annotations

import errno
import os

try:
    import fcntl
except ImportError:  # Windows
    HAS_FLOCK = False
else:
    HAS_FLOCK = True

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
