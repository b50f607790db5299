"""Long work in a process that can be ended, and its call; its outputs are complete or absent."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import tempfile
import threading
import time
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import IO

from pydantic import BaseModel, ConfigDict

from dbbstation.system.children import end_tree, python_module


class SessionTask(StrEnum):
    """Steps after a session in their usual order."""

    CALIBRATE = "calibrate"
    DIAGNOSE = "diagnose"
    PROGRAMS = "programs"
    REPORT = "report"
    ACCEPTANCE = "acceptance"
    FIGURES = "figures"
    HISTORY = "history"


class Call(BaseModel):
    """One task with its parameters and outputs, as the command of this name has them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    """Name of the command."""
    given: dict[str, str]
    """Values by parameter; what is missing comes from the settings."""
    outputs: dict[str, str] = {}
    """Files to write, by the option that names them on the command line."""
    beside: Path
    """Folder that may contain the shop's settings."""
    settings: Path | None = None
    """File of the shop's settings, if one was named."""
    tolerances: Path | None = None
    """Settings with the tolerances of an operator's job, which replace the shop's."""
    force: bool = True
    """Whether existing files are replaced: only the program writes into the folder of results."""


WORKER = "dbbstation.service.worker"
"""Module that the process runs. The station never imports it, since it imports all computations."""

STAGE_MARK = "stage: "
"""First characters of a line that names a stage of the work."""

LOG_MARK = "log: "
"""First characters of a line for the log."""

_LOG = logging.getLogger(__name__)

_POLITE_S = 3.0
"""Time between the request to end and the forced end of the process [s]."""


class WorkProgress(StrEnum):
    """State of the work."""

    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class BackgroundWork:
    """One job, begun at once.

    Attributes:
        stage: reported by the work; empty at first.
    """

    def __init__(self, call: Call, folder: Path) -> None:
        self.call = call
        self.stage = ""
        self._begun_s = time.monotonic()
        self._ended_s: float | None = None
        self._cancelled = False
        self._said: list[str] = []
        # A file takes any amount; a pipe that nobody reads would hold the work up.
        self._answer: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(  # noqa: S603 - a module of the program
            python_module(WORKER),
            cwd=folder,
            # Read when NumPy is imported: the threads that `dbbstation.computing.threads` takes away are not even started.
            env={"OPENBLAS_NUM_THREADS": "1", **os.environ},
            stdin=subprocess.PIPE,
            stdout=self._answer,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        self._tell()
        self._listener = threading.Thread(target=self._listen, name="work", daemon=True)
        self._listener.start()

    @property
    def progress(self) -> WorkProgress:
        """Return its state."""
        code = self._process.poll()
        if code is None:
            return WorkProgress.RUNNING
        self._ended_s = self._ended_s or time.monotonic()
        if self._cancelled:
            return WorkProgress.CANCELLED
        return WorkProgress.DONE if code == 0 else WorkProgress.FAILED

    @property
    def passed_s(self) -> float:
        """Return the time from begin to end [s]."""
        return (self._ended_s or time.monotonic()) - self._begun_s

    def wait(self) -> WorkProgress:
        """Wait for its end; return how it ended."""
        self._process.wait()
        return self.progress

    def answer(self) -> dict[str, object]:
        """Return the JSON result once done."""
        self._answer.seek(0)
        found: dict[str, object] = json.loads(self._answer.read())
        return found

    def failure(self) -> str:
        """Return the failure, if any."""
        self._listener.join(_POLITE_S)
        return "\n".join(self._said[-4:])

    def cancel(self) -> None:
        """Ask the work to end, as Ctrl-C does, by ending its input."""
        self._cancelled = self._cancelled or self._process.poll() is None
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def close(self) -> None:
        """End it and wait."""
        self.cancel()
        try:
            self._process.wait(_POLITE_S)
        except subprocess.TimeoutExpired:
            end_tree(self._process)
        self._listener.join()
        if self._process.stderr is not None:
            self._process.stderr.close()
        self._answer.close()

    def _tell(self) -> None:
        if self._process.stdin is None:
            return
        with suppress(OSError):
            self._process.stdin.write(self.call.model_dump_json() + "\n")
            self._process.stdin.flush()

    def _listen(self) -> None:
        if self._process.stderr is None:
            return
        for line in self._process.stderr:
            text = line.rstrip()
            if text.startswith(STAGE_MARK):
                self.stage = text.removeprefix(STAGE_MARK)
            elif text.startswith(LOG_MARK):
                _LOG.info("%s", text.removeprefix(LOG_MARK))
            elif text:
                self._said.append(text)
