"""Ports of virtual instruments on this computer, marked by files with the process's number."""

from __future__ import annotations

import os
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def marked_virtual(port: str) -> Iterator[None]:
    """Mark a port of this process as virtual."""
    mark = _mark(port)
    with suppress(OSError):  # a mark that cannot be written costs the word VIRTUAL, not the machine
        mark.parent.mkdir(exist_ok=True)
        mark.write_text(str(os.getpid()), encoding="ascii")
    try:
        yield
    finally:
        with suppress(OSError):
            mark.unlink()


def is_virtual(port: str) -> bool:
    """Return whether a running program of this computer has marked the port.

    Bridges and replays are not detected.
    """
    try:
        process = int(_mark(port).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return False
    return _runs(process)


def _runs(process: int) -> bool:
    if os.name != "posix":  # there a signal would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _mark(port: str) -> Path:
    name = port if "//" in port else os.path.realpath(port)
    return Path(tempfile.gettempdir()) / "dbbstation-virtual" / quote(name, safe="")
