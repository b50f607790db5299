"""Start child processes: separate from their working folder, bounded, and ended with all their children."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

import psutil

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

_SESSION = hasattr(os, "setsid")
_FLAGS = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
"""Flags for a separate process group, so that Ctrl-C at the terminal reaches only the parent, which ends the group."""

_LOOK_S = 0.2
"""Interval of the checks of bounds [s]; a short run ends before the first check."""

_TAIL_BYTES = 1 << 16
"""Number of kept bytes of an output; its end states why a program failed."""

_BLOCK_BYTES = 1 << 16

_PATIENCE_S = 5.0


@dataclass(frozen=True)
class ProgramBounds:
    """Bounds of a program and its children.

    Attributes:
        time_s: longest time [s].
        memory_mb: memory of all its processes together [MB].
        output_mb: bytes on each of its outputs [MB], and in the folder that it works in.
    """

    time_s: float
    memory_mb: float
    output_mb: float


@dataclass(frozen=True)
class ProgramEnd:
    """How a program ended."""

    code: int
    said: str


class BoundExceededError(Exception):
    """A program exceeded a bound and was ended."""

    def __init__(self, what: str, *, of_time: bool = False) -> None:
        super().__init__(what)
        self.of_time = of_time


def python_module(name: str, *words: str) -> list[str]:
    """Return the command that runs a module of the program; modules in the working folder are never loaded."""
    return [sys.executable, "-P", "-m", name, *words]


def run_bounded(command: Sequence[str], folder: Path, bounds: ProgramBounds) -> ProgramEnd:
    """Run a program to its end.

    Args:
        bounds: beyond these it is ended with all its children.

    Raises:
        BoundExceededError: it exceeds a bound.
        OSError: it cannot be started.
    """
    process = subprocess.Popen(  # noqa: S603 - what the user named, or a browser
        command,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=_SESSION,
        creationflags=_FLAGS,
    )
    outputs = [_Output(stream, bounds.output_mb) for stream in (process.stdout, process.stderr) if stream is not None]
    try:
        _watch(process, folder, bounds, outputs)
    finally:
        end_tree(process)
        for output in outputs:
            output.close()
    return ProgramEnd(process.returncode, outputs[-1].tail.decode("utf-8", "replace"))


def _watch(process: subprocess.Popen[bytes], folder: Path, bounds: ProgramBounds, outputs: Sequence[_Output]) -> None:
    until_s = time.monotonic() + bounds.time_s
    running = True
    while running:
        if not any(output.full.is_set() for output in outputs):
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(min(_LOOK_S, until_s - time.monotonic()), 0.0))
                running = False
        if any(output.full.is_set() for output in outputs) or _megabytes_in(folder) > bounds.output_mb:
            raise BoundExceededError(f"writes more than {bounds.output_mb:g} MB")
        if running and time.monotonic() >= until_s:
            raise BoundExceededError(f"takes longer than {bounds.time_s:g} s", of_time=True)
        if running and _memory_mb(process.pid) > bounds.memory_mb:
            raise BoundExceededError(f"takes more than {bounds.memory_mb:g} MB of memory")


class _Output:
    """Reads a program's output, so that the program never waits, and keeps the end."""

    def __init__(self, stream: IO[bytes], most_mb: float) -> None:
        self.tail = b""
        self.full = threading.Event()
        self._stream, self._left = stream, most_mb * 1e6
        self._reader = threading.Thread(target=self._read, name="output", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        with suppress(OSError, ValueError):
            while piece := os.read(self._stream.fileno(), _BLOCK_BYTES):
                self._left -= len(piece)
                self.tail = (self.tail + piece)[-_TAIL_BYTES:]
                if self._left < 0:
                    self.full.set()

    def close(self) -> None:
        """Read the remaining output, unless a process outside the group still holds the pipe."""
        self._reader.join(_PATIENCE_S)
        if not self._reader.is_alive():
            self._stream.close()


def is_root() -> bool:
    """Return whether this user is root; False on Windows."""
    return hasattr(os, "geteuid") and os.geteuid() == 0


def end_tree(process: subprocess.Popen[Any]) -> None:
    """End a child process and all its children, if they still run."""
    # The number of a process that has ended may belong to somebody else's by now.
    tree = list(_tree(process.pid)) if process.poll() is None else []
    if hasattr(os, "killpg"):
        with suppress(OSError):  # the group is gone, or the process has none of its own
            if process.returncode is not None or os.getpgid(process.pid) == process.pid:
                os.killpg(process.pid, signal.SIGKILL)
    for one in tree:
        with suppress(psutil.Error):
            one.kill()
    if process.poll() is None:
        process.kill()
    with suppress(subprocess.TimeoutExpired):
        process.wait(_PATIENCE_S)


def _tree(pid: int) -> Iterator[psutil.Process]:
    """Yield a running process and all its children."""
    with suppress(psutil.Error):
        root = psutil.Process(pid)
        yield from (*root.children(recursive=True), root)


def _memory_mb(pid: int) -> float:
    total = 0.0
    for one in _tree(pid):
        with suppress(psutil.Error):
            total += one.memory_info().rss / 1e6
    return total


def _megabytes_in(folder: Path) -> float:
    total = 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            total += path.lstat().st_size
    return total / 1e6
