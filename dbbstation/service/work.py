"""Long work in a process of its own: the program's own commands, so that what they write says how to get it again.

A process can be ended at any time; what its command writes is written whole or not at all.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from enum import StrEnum
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

STAGE_MARK = "... "
"""How the log names a stage of long work."""

_LOG_MARK = "log: "

_POLITE_S = 3.0
"""A command that was asked to end has so long before it is ended [s]."""


class WorkProgress(StrEnum):
    """How work stands."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class BackgroundWork:
    """One command of the program, started at once.

    Args:
        arguments: of the command, without the program's name; `--json` is added.
        folder: where it runs.

    Attributes:
        arguments: as given.
        stage: what it does now, as it says itself; empty before it says anything.
    """

    def __init__(self, arguments: Sequence[str], folder: Path) -> None:
        self.arguments = tuple(arguments)
        self.stage = ""
        self._begun_s = time.monotonic()
        self._ended_s: float | None = None
        self._cancelled = False
        self._said: list[str] = []
        # A file takes any amount; a pipe that nobody reads would hold the command up.
        self._answer: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(  # noqa: S603 - the program's own commands
            [sys.executable, "-m", "dbbstation", "--verbose", *arguments, "--json"],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=self._answer,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        self._listener = threading.Thread(target=self._listen, name="work", daemon=True)
        self._listener.start()

    @property
    def progress(self) -> WorkProgress:
        """How it stands."""
        code = self._process.poll()
        if code is None:
            return WorkProgress.RUNNING
        self._ended_s = self._ended_s or time.monotonic()
        if self._cancelled:
            return WorkProgress.CANCELLED
        return WorkProgress.DONE if code == 0 else WorkProgress.FAILED

    @property
    def passed_s(self) -> float:
        """Time since it began, until it ended [s]."""
        return (self._ended_s or time.monotonic()) - self._begun_s

    def wait(self) -> WorkProgress:
        """Wait for its end; return how it ended."""
        self._process.wait()
        return self.progress

    def answer(self) -> dict[str, Any]:
        """Return what the command printed, once it is done."""
        self._answer.seek(0)
        found: dict[str, Any] = json.loads(self._answer.read())
        return found

    def failure(self) -> str:
        """Return what the command said last, once it has failed."""
        self._listener.join(_POLITE_S)
        return "\n".join(self._said[-4:])

    def cancel(self) -> None:
        """Ask it to end, as Ctrl-C does; does nothing once it has ended."""
        if self._process.poll() is not None:
            return
        self._cancelled = True
        with suppress(OSError):
            self._process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """End it, and wait for that."""
        self.cancel()
        try:
            self._process.wait(_POLITE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join()
        if self._process.stderr is not None:
            self._process.stderr.close()
        self._answer.close()

    def _listen(self) -> None:
        if self._process.stderr is None:
            return
        for line in self._process.stderr:
            text = line.rstrip()
            if text.startswith(_LOG_MARK + STAGE_MARK):
                self.stage = text.removeprefix(_LOG_MARK + STAGE_MARK)
            elif text and not text.startswith(_LOG_MARK):
                self._said.append(text)
