"""Signals that end a program: Ctrl-C, a polite kill, a closed terminal."""

from __future__ import annotations

import os
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

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


def end_as_hung_up() -> None:
    """End this program as if its terminal had closed."""
    os.kill(os.getpid(), CLOSED[0] if CLOSED else KILLED_POLITELY)
