"""One writer for each session folder: a lock that its process holds and that ends with it.

The lock is one of the operating system on a file in the folder: it is gone when the process is, however that ends, so that
nothing has to be cleaned up after a power cut. The file stays and says who held it last. On a network folder the lock holds as far
as the file server passes it on; where a file system has no locks the session is written without one, and says so.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import sys
from typing import TYPE_CHECKING, Self

from dbbstation.errors import OutputError

if TYPE_CHECKING:
    from pathlib import Path

if sys.platform != "win32":  # Windows has locks of its own
    import fcntl

LOCK_FILE = ".lock"
"""In the session folder; nothing reads it but this."""

_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS}


class SessionLock:
    """The right to write into a session, held until it is closed or the process ends.

    Args:
        folder: of the session.

    Attributes:
        held: whether the file system gave a lock; False where it knows none.

    Raises:
        OutputError: another process writes into the session, or the folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / LOCK_FILE
        try:
            self._file: int | None = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise OutputError(
                f"cannot be written: {why}", where=str(path), remedy="check the folder's permissions"
            ) from error
        self.held = self._locked(folder)
        if self.held:
            with contextlib.suppress(OSError):  # a full disk must not keep anybody from going on
                os.ftruncate(self._file, 0)
                os.pwrite(self._file, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)

    def __enter__(self) -> Self:
        """Return the lock."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let others write."""
        self.close()

    def __del__(self) -> None:
        """Let others write where nobody closed it."""
        self.close()

    def close(self) -> None:
        """Let others write; may be called twice."""
        file, self._file = getattr(self, "_file", None), None
        if file is not None:
            os.close(file)

    def _locked(self, folder: Path) -> bool:
        if sys.platform == "win32" or self._file is None:
            return False
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            who = os.pread(self._file, 200, 0).decode(errors="replace").strip()
            self.close()
            raise OutputError(
                f"{who or 'another process'} writes into this session",
                where=str(folder),
                remedy="end it first, or measure into another folder",
            ) from error
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return False
            self.close()
            raise OutputError(f"cannot be locked: {error.strerror}", where=str(folder)) from error
        return True
