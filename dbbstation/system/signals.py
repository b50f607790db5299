"""Signals that end a program: Ctrl-C, a polite kill, a terminal that is closed."""

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
"""A terminal or a console window that is closed. Windows sends SIGBREAK then (Microsoft, "HandlerRoutine", CTRL_CLOSE_EVENT)."""


@contextmanager
def answered(numbers: Sequence[signal.Signals], answer: Callable[[signal.Signals], object]) -> Iterator[None]:
    """Answer signals with a function while the context lasts.

    Args:
        numbers: of the signals.
        answer: called with the signal, between two instructions of the main thread.
    """
    before = {number: signal.signal(number, lambda got, _frame: answer(signal.Signals(got))) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupt_on(*numbers: signal.Signals) -> None:
    """Let signals raise KeyboardInterrupt from now on, also if a shell made the program deaf to them."""
    for number in numbers:
        signal.signal(number, signal.default_int_handler)


@contextmanager
def politely_ended() -> Iterator[None]:
    """Turn a polite kill and a closed terminal into KeyboardInterrupt: half-written files go, processes end, the log says so.

    What `nohup` made the program deaf to stays so.
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
    """Processes that start now ignore Ctrl-C as long as they live, and load no module of the working folder.

    This process alone answers Ctrl-C. A folder that somebody handed over may hold a `random.py`; PYTHONSAFEPATH keeps
    it out of the first imports of a process (Python, "Command line and environment").
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
    """Let programs that a process of ours starts find modules as users expect; to be called first in such a process."""
    if os.environ.get(_SAFE) == _OURS:
        del os.environ[_SAFE]


_SAFE, _OURS = "PYTHONSAFEPATH", "dbbstation"


def end_as_hung_up() -> None:
    """End this program as if its terminal had closed."""
    os.kill(os.getpid(), CLOSED[0] if CLOSED else KILLED_POLITELY)
