"""Replace and remove files; on Windows another program may hold them for a moment."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PATIENCE_S = 2.0
"""Time for which a virus scanner or an indexer may hold a new file [s]."""

_PAUSE_S = 0.02

_HELD = {5, 32, 33}
"""Windows: access denied, sharing violation, lock violation (Microsoft, "System Error Codes (0-499)")."""


def replace(path: Path, target: Path) -> None:
    """Rename a file to the name of another file, which it replaces.

    Windows refuses to replace a read-only file, or a file that a program has open.

    Raises:
        OSError: the system refuses; both files are as before.
    """
    _patiently(lambda: path.replace(target), target)


def rename(path: Path, target: Path) -> None:
    """Rename a file or folder to an unused name.

    Raises:
        OSError: the system refuses.
    """
    _patiently(lambda: path.rename(target))


def remove(path: Path) -> None:
    """Remove a file if it is there.

    Raises:
        OSError: the system refuses.
    """
    _patiently(lambda: path.unlink(missing_ok=True), path)


def remove_tree(folder: Path) -> None:
    """Remove a folder and its content, as far as the system allows."""
    for path in folder.rglob("*"):
        with contextlib.suppress(OSError):
            if path.is_file() and not path.is_symlink() and not path.stat().st_mode & stat.S_IWUSR:
                path.chmod(path.stat().st_mode | stat.S_IWUSR)  # Windows deletes no file that may only be read
    shutil.rmtree(folder, ignore_errors=True)


def sync_folder(folder: Path) -> None:
    """Make renames in a folder survive a power cut. On Windows this does nothing: it cannot open folders, and its file system keeps a journal of names."""
    with contextlib.suppress(PermissionError, NotADirectoryError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _made_writable(path: Path, error: OSError) -> bool:
    if getattr(error, "winerror", None) not in _HELD or not path.is_file():
        return False
    if path.stat().st_mode & stat.S_IWUSR:
        return False
    path.chmod(path.stat().st_mode | stat.S_IWUSR)
    return True


def _patiently(act: Callable[[], object], written: Path | None = None) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            act()
        except PermissionError as error:
            if written is not None and _made_writable(written, error):
                continue
            if getattr(error, "winerror", None) not in _HELD or time.monotonic() > until_s:
                raise
            time.sleep(_PAUSE_S)
        else:
            return
