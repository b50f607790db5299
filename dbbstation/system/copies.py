"""Run a module of the program as copies of one process that has imported it, instead of importing it each time."""

from __future__ import annotations

import gc
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from multiprocessing.connection import Connection, wait
from typing import TYPE_CHECKING, Protocol, TypeAlias

from dbbstation.system.children import python_module
from dbbstation.system.handles import open_nothing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import AbstractContextManager
    from multiprocessing.process import BaseProcess
    from pathlib import Path

    Running: TypeAlias = "subprocess.Popen[str] | _Copy"

    class Starter(Protocol):
        """Runs a module with words in a folder. The context ends the process."""

        def __call__(self, words: Sequence[str], folder: Path, *, answers: bool) -> AbstractContextManager[Running]:
            """Keep the standard output if it `answers`; otherwise discard it."""


_PATIENCE_S = 10.0


@contextmanager
def copies(module: str, loaded: str) -> Iterator[Starter]:
    """Yield a function that runs `python -m MODULE WORDS`.

    If processes cannot be copied, as on Windows, each one imports everything.

    Args:
        loaded: module that the copied process imports besides.
    """
    with copied_process(module, loaded) as copied:
        yield partial(_running, partial(_new, module) if copied is None else partial(_Copy, copied))


@contextmanager
def copied_process(module: str, loaded: str) -> Iterator[CopiedProcess | None]:
    """Yield the process that is copied; None if processes cannot be copied."""
    if not hasattr(os, "fork"):
        yield None
        return
    here, there = multiprocessing.Pipe()
    with there:
        line = there.fileno()
        command = python_module(__name__, str(line), module, loaded)
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=[line])  # noqa: S603 - this module
    # It ends when its line is closed. Its processor time, and that of all copies, then counts as this process's.
    with process, here:
        yield CopiedProcess(here)


class CopiedProcess:
    """The process that is copied, at the end of a line."""

    def __init__(self, line: Connection) -> None:
        self._line = line
        self._codes: dict[int, int] = {}

    def begin(self, words: Sequence[str], folder: Path | str, streams: Sequence[int]) -> int:
        """Begin a copy and return its number.

        Args:
            streams: its three standard streams, which stay open here.
        """
        from multiprocessing.reduction import send_handle  # noqa: PLC0415 - of another kind on Windows

        self._line.send((list(words), str(folder)))
        for stream in streams:
            send_handle(self._line, stream, 0)
        while not (pid := self._told()):
            pass
        return pid

    def code_of(self, pid: int, timeout: float | None) -> int | None:
        """Return the exit code of a copy; None if it still runs after the timeout [s]."""
        while pid not in self._codes and self._line.poll(timeout):
            self._told()
        return self._codes.get(pid)

    def _told(self) -> int:
        """Return the number of a copy that begins; keep the exit code of one that ends, and return 0."""
        pid, code = self._line.recv()
        if code is None:
            return int(pid)
        self._codes[pid] = code
        return 0


@contextmanager
def _running(
    begin: Callable[..., Running],
    words: Sequence[str],
    folder: Path,
    *,
    answers: bool,
) -> Iterator[Running]:
    process = begin(words, folder, answers=answers)
    try:
        yield process
    except BaseException:
        process.terminate()
        raise
    finally:
        try:
            process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def _new(module: str, words: Sequence[str], folder: Path, *, answers: bool) -> subprocess.Popen[str]:
    out = subprocess.PIPE if answers else subprocess.DEVNULL
    command = python_module(module, *words)
    return subprocess.Popen(command, cwd=folder, stdout=out, stderr=subprocess.PIPE, text=True)  # noqa: S603 - a module of the program


class _Copy:
    """A copy of a process, with the names of `subprocess.Popen`."""

    def __init__(self, copied: CopiedProcess, words: Sequence[str], folder: Path, *, answers: bool) -> None:
        self._copied = copied
        nothing = open_nothing()
        out, its_out = os.pipe() if answers else (None, nothing)
        err, its_err = os.pipe()
        self.stdout = None if out is None else os.fdopen(out, encoding="locale")
        self.stderr = os.fdopen(err, encoding="locale")
        self._pid = copied.begin(words, folder, (nothing, its_out, its_err))
        for end in {nothing, its_out, its_err}:
            os.close(end)

    def communicate(self) -> tuple[str, str]:
        """Return both outputs at their end."""
        said = list[str]()
        reader = threading.Thread(target=lambda: said.append(self.stderr.read()), name="said", daemon=True)
        reader.start()
        out = "" if self.stdout is None else self.stdout.read()
        reader.join()
        return out, said[0]

    def terminate(self) -> None:
        """End it politely."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self._send(signal.SIGKILL)

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code.

        Raises:
            TimeoutExpired: it still runs.
        """
        code = self._copied.code_of(self._pid, timeout)
        if code is None:
            raise subprocess.TimeoutExpired([], timeout or 0.0)
        return code

    def _send(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.kill(self._pid, number)


def _serve(line: Connection, module: str, loaded: str) -> None:
    """Import modules, and run copies on request until the line is closed."""
    from multiprocessing.reduction import recv_handle  # noqa: PLC0415 - of another kind on Windows

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asked for a copy ends it
    import_module(loaded)
    del sys.modules[import_module(f"{module}.__main__").__name__]  # each copy runs it
    gc.collect()
    gc.freeze()
    context = multiprocessing.get_context("fork")
    running: dict[int, BaseProcess] = {}
    with suppress(EOFError, BrokenPipeError):
        while True:
            for ready in wait([line, *running]):
                if isinstance(ready, int):
                    process = running.pop(ready)
                    process.join()
                    line.send((process.pid, process.exitcode))
                    continue
                words, folder = line.recv()
                streams = [recv_handle(line) for _ in range(3)]
                process = context.Process(target=_become, args=(line, module, words, folder, streams))
                process.start()
                running[process.sentinel] = process
                line.send((process.pid, None))
                for end in streams:
                    os.close(end)
    for process in running.values():
        process.terminate()


def _become(line: Connection, module: str, words: Sequence[str], folder: str, streams: Sequence[int]) -> None:
    line.close()
    os.chdir(folder)
    for number, end in enumerate(streams):
        os.dup2(end, number)
        os.close(end)
    sys.argv[1:] = words
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _serve(Connection(int(sys.argv[1])), *sys.argv[2:])
