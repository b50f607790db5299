"""Allow one writer per session folder, by a lock of the operating system.

The lock ends with its process, so a power cut leaves none.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from typing import TYPE_CHECKING

from dbbstation.errors import OutputError, unwritable
from dbbstation.files.atomic import told_of
from dbbstation.system.handles import Closing, lock, open_to_change, read_at, write_at

if TYPE_CHECKING:
    from pathlib import Path

LOCK_FILE = ".lock"
"""Name of the lock's file in the session folder."""

PATIENCE_S = 2.0
"""Longest wait of a command that writes one note for another such command [s]."""

_PAUSE_S = 0.01


class SessionLock(Closing):
    """The right to write into a session, until closed or the process ends.

    Attributes:
        held: False if the file system has no locks.

    Raises:
        OutputError: another process writes into the session, or the folder cannot be written.
    """

    def __init__(self, folder: Path, patience_s: float = 0.0) -> None:
        self._file: int | None = None
        until_s = time.monotonic() + patience_s
        while True:
            self._open(folder)
            self.held = self._locked(folder, until_s)
            if not self.held or self._in_place(folder):
                break
            self.close()  # somebody removed the file while it was waited for: the next one makes another
        if self.held and self._file is not None:
            with contextlib.suppress(OSError):  # a full disk must not keep anybody from going on
                os.ftruncate(self._file, 0)
                write_at(self._file, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)

    def __del__(self) -> None:
        """Close a forgotten lock."""
        self.close()

    def close(self) -> None:
        """Unlock the session for others; may be called twice."""
        file, self._file = getattr(self, "_file", None), None
        if file is not None:
            os.close(file)

    def _open(self, folder: Path) -> None:
        path = folder / LOCK_FILE
        with told_of(path):
            self._file = open_to_change(path, create=True)

    def _in_place(self, folder: Path) -> bool:
        if self._file is None:
            return False
        try:
            return os.path.samestat(os.fstat(self._file), (folder / LOCK_FILE).lstat())
        except OSError:
            return False

    def _locked(self, folder: Path, until_s: float) -> bool:
        if self._file is None:
            return False
        while True:
            try:
                return lock(self._file)
            except BlockingIOError as error:
                if time.monotonic() < until_s:
                    time.sleep(_PAUSE_S)
                    continue
                who = read_at(self._file, 200, 0).decode(errors="replace").strip()
                self.close()
                raise OutputError(
                    f"{who or 'another process'} writes into this session",
                    where=str(folder),
                    remedy="end it first, or measure into another folder",
                ) from error
            except OSError as error:
                self.close()
                raise unwritable(error, folder, "locked") from error
