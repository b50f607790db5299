"""Fails any test that leaves a thread or a file descriptor open."""

from __future__ import annotations

import gc
import os
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

_FDS = Path("/proc/self/fd")
_FOR_GOOD = ("kernel", "dbbstation-kernel")
"""Threads of the numerical kernels: started once in a process, when one is first needed."""


def _open_files() -> dict[str, str]:
    if not _FDS.exists():
        return {}
    found = {}
    for fd in os.listdir(_FDS):  # noqa: PTH208 (iterdir keeps the folder open while it is read)
        try:
            found[fd] = os.readlink(_FDS / fd)  # noqa: PTH115 (names such as "socket:[123]" are no paths)
        except OSError:
            continue
    return found


@pytest.fixture(autouse=True)
def nothing_left_open() -> Iterator[None]:
    threads = set(threading.enumerate())
    files = _open_files()
    yield
    left = [each for each in threading.enumerate() if each not in threads and not each.name.startswith(_FOR_GOOD)]
    for thread in left:
        thread.join(1.0)
    assert not [thread for thread in left if thread.is_alive()], "the test left a thread running"
    for attempt in range(5):
        opened = {fd: name for fd, name in _open_files().items() if files.get(fd) != name and "/proc/" not in name}
        if not opened:
            return
        gc.collect()
        time.sleep(0.01 * attempt)
    assert not opened, f"the test left files open: {opened}"
