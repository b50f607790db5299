"""What ends a program: Ctrl-C, a polite kill, a closed terminal, one that vanishes."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.system.handles import open_nothing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Signals = signal.Signals

CTRL_C = signal.SIGINT

KILLED_POLITELY = signal.SIGTERM

CLOSED = tuple(getattr(signal, name) for name in ("SIGHUP", "SIGBREAK") if hasattr(signal, name))
"""Signal of a closed terminal or console window. Windows sends SIGBREAK (Microsoft, "HandlerRoutine",
CTRL_CLOSE_EVENT)."""


@contextmanager
def answered(numbers: Sequence[signal.Signals], answer: Callable[[signal.Signals], object]) -> Iterator[None]:
    """Call a function on signals while the context lasts."""
    before = {number: signal.signal(number, lambda got, _frame: answer(signal.Signals(got))) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupt_on(*numbers: signal.Signals) -> None:
    """Let signals raise KeyboardInterrupt from now on, even if a shell made the program ignore them."""
    for number in numbers:
        signal.signal(number, signal.default_int_handler)


@contextmanager
def politely_ended() -> Iterator[None]:
    """Turn a polite kill and a closed terminal into KeyboardInterrupt, so that partial files are removed, processes end, and the log is written.

    Signals ignored by `nohup` stay ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [one for one in (KILLED_POLITELY, *CLOSED) if signal.getsignal(one) is signal.SIG_DFL]
    interrupt_on(*numbers)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def starting() -> Iterator[None]:
    """Make child processes ignore Ctrl-C for life, and load no module of the working folder.

    Only this process handles Ctrl-C. A folder from elsewhere may contain a `random.py`; PYTHONSAFEPATH keeps it out of
    the first imports of a process (Python, "Command line and environment").
    """
    safe = os.environ.setdefault(_SAFE, _OURS) == _OURS
    ignored = threading.current_thread() is threading.main_thread()
    before = signal.signal(CTRL_C, signal.SIG_IGN) if ignored else None
    try:
        yield
    finally:
        if ignored:
            signal.signal(CTRL_C, before)
        if safe:
            os.environ.pop(_SAFE, None)


def started() -> None:
    """Let user programs in a child process find modules as usual; call it first in such a process."""
    if os.environ.get(_SAFE) == _OURS:
        del os.environ[_SAFE]


_SAFE, _OURS = "PYTHONSAFEPATH", "dbbstation"


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
    os.kill(os.getpid(), CLOSED[0] if CLOSED else KILLED_POLITELY)
    if not over.wait(_PATIENCE_S):
        last()
        os._exit(_FAILED)
