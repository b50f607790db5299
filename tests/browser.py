"""A headless Chromium for tests, driven by the DevTools protocol over two pipes: no port is opened, no package needed."""

from __future__ import annotations

import base64
import contextlib
import importlib.util
import json
import os
import select
import shutil
import signal
import tempfile
import time
from pathlib import Path
from typing import Any, Self

PATIENCE_S = 100.0
"""For one answer. A browser that takes longer waits for something that does not come [s]."""

DESKTOP, PHONE = (1280, 800), (390, 844)
"""Widths and heights of screens [CSS px]."""


def chromium() -> str | None:
    return shutil.which("chromium") if hasattr(os, "posix_spawn") else None


def axe_script() -> str | None:
    """The text of axe-core, from the file that DBBSTATION_AXE names or else from the package `axe-core-python`."""
    named = os.environ.get("DBBSTATION_AXE")
    package = importlib.util.find_spec("axe_core_python")
    if named is None and package is not None and package.origin is not None:
        named = str(Path(package.origin).with_name("axe.min.js"))
    return None if named is None else Path(named).read_text("utf-8")


class Browser:
    """One page of one Chromium.

    Attributes:
        complaints: what the console or the log of the page was told since the last `open`.
    """

    def __init__(self) -> None:
        import fcntl  # noqa: PLC0415 - not on every system, and this module is imported on all

        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        commands, self._out = os.pipe()
        self._in, answers = os.pipe()
        # Away from 3 and 4, so that neither is overwritten before it is copied there.
        ends = [fcntl.fcntl(one, fcntl.F_DUPFD_CLOEXEC, 10) for one in (commands, answers)]
        self._pid = os.posix_spawn(
            str(chromium()),
            [
                "chromium",
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--remote-debugging-pipe",
                f"--user-data-dir={self._folder.name}/profile",
            ],
            {**os.environ, "HOME": self._folder.name, "XDG_CONFIG_HOME": self._folder.name},
            file_actions=[
                (os.POSIX_SPAWN_DUP2, ends[0], 3),
                (os.POSIX_SPAWN_DUP2, ends[1], 4),
                (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0),
            ],
            setpgroup=0,
        )
        for one in (commands, answers, *ends):
            os.close(one)
        self._buffer, self._number, self._session = b"", 0, None
        self.complaints: list[str] = []
        self._events: list[str] = []
        target = self.do("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.do("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.do(f"{domain}.enable")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._pid, signal.SIGKILL)
        os.waitpid(self._pid, 0)
        for one in (self._in, self._out):
            os.close(one)
        self._folder.cleanup()

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        while True:
            answer = self._received()
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer["error"])
                return answer["result"]

    def open(self, page: Path, size: tuple[int, int] = DESKTOP, *, dark: bool = False, paper: bool = False) -> None:
        width, height = size
        self.do(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=size == PHONE
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.do("Emulation.setEmulatedMedia", media="print" if paper else "screen", features=[scheme])
        self.complaints.clear()
        self._events.clear()
        assert "errorText" not in self.do("Page.navigate", url=page.as_uri())
        while "Page.loadEventFired" not in self._events:
            self._received()

    def run(self, script: str) -> Any:
        answer = self.do("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def press(self, key: str) -> None:
        codes = {"Tab": 9, "Enter": 13, "ArrowRight": 39}
        text = {"text": "\r"} if key == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self.do("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key], **text)

    def picture(self, out: Path) -> None:
        shot = self.do("Page.captureScreenshot", captureBeyondViewport=True)
        out.write_bytes(base64.b64decode(shot["data"]))

    def _received(self) -> dict[str, Any]:
        until = time.monotonic() + PATIENCE_S
        while b"\0" not in self._buffer:
            ready, _, _ = select.select([self._in], [], [], max(0.0, until - time.monotonic()))
            assert ready, "the browser does not answer"
            data = os.read(self._in, 1 << 20)
            assert data, "the browser has ended"
            self._buffer += data
        one, _, self._buffer = self._buffer.partition(b"\0")
        message = json.loads(one)
        method, parameters = message.get("method", ""), message.get("params", {})
        self._events.append(method)
        if method == "Log.entryAdded":
            self.complaints.append(parameters["entry"]["text"])
        elif method == "Runtime.consoleAPICalled":
            self.complaints.append(str(parameters["args"]))
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(str(parameters["exceptionDetails"]))
        return message
