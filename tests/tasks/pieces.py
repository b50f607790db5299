"""Pieces of work for other processes, some of which end their process. A process imports this module: it needs nothing else."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path


def squared(item):
    number, _ = item
    return number**2, os.getpid()


def ends_once(item):
    """As `squared`; the first process that gets a number below zero is killed, as by a computer that runs out of memory."""
    number, folder = item
    mark = Path(folder) / "ended"
    if number < 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(item)


def ends_always(item):
    if item[0] < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(item)


def told_and_slow(item):
    """As `squared`, once it was noted that this process works on the number; slow enough to be killed meanwhile."""
    number, folder = item
    (Path(folder) / f"{number}-{os.getpid()}").touch()
    time.sleep(0.3)
    return squared(item)
