"""Handle a terminal that vanishes: a closed window, a broken connection, a killed server."""

from __future__ import annotations

import os
import select
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.system.handles import open_nothing
from dbbstation.system.signals import end_as_hung_up

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_LOOK_MS = 500
_PATIENCE_S = 10.0
"""Time for the screen to end by itself [s]; it may hang while it writes to a terminal that is gone."""

_FAILED = 1
"""Exit code."""


@contextmanager
def ended_when_hung_up(last: Callable[[], None]) -> Iterator[None]:
    """Watch the terminal and end the program when it is gone. Without a terminal, or on Windows, do nothing.

    The screen's own output stops at the first failing write and then blocks, and the kernel's signal may go to a shell
    that keeps it. Windows ends the programs of a closing console.

    Args:
        last: ends the work, in its own thread, if the screen does not end by itself.
    """
    if not hasattr(select, "poll") or not sys.stdin.isatty():
        yield
        return
    over = threading.Event()
    threading.Thread(target=_watch, args=(sys.stdin.fileno(), over, last), name="hang-up", daemon=True).start()
    try:
        yield
    finally:
        over.set()


def _watch(terminal: int, over: threading.Event, last: Callable[[], None]) -> None:
    poll = select.poll()
    poll.register(terminal, 0)  # a hang-up is reported whatever is asked for
    while not poll.poll(_LOOK_MS):
        if over.is_set():
            return
    nowhere = open_nothing()
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    end_as_hung_up()
    if not over.wait(_PATIENCE_S):
        last()
        os._exit(_FAILED)
