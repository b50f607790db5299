"""An open port that plays a script: these bytes are expected, those come back, and nothing else may happen."""

from __future__ import annotations

import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


class ScriptedPort:
    """Pairs of (bytes that the driver must write, bytes that it then gets); an empty first half is said unasked.

    A driver asks on until it is stopped, so further writes of the last expected bytes are allowed and stay unanswered.
    """

    name = "scripted"

    def __init__(self, script: list[tuple[bytes, bytes]]) -> None:
        self._script = list(script)
        self._readable = bytearray()
        self._lock = threading.Lock()
        self._last = script[-1][0]
        self.wrong: list[bytes] = []
        self.closed = False
        self._say_unasked()

    @property
    def in_waiting(self) -> int:
        return len(self._readable)

    def read(self, size: int = 1) -> bytes:
        if not self._readable:
            time.sleep(0.002)
        with self._lock:
            raw = bytes(self._readable[:size])
            del self._readable[:size]
        return raw

    def write(self, data: bytes) -> int:
        with self._lock:
            if self._script and self._script[0][0] == data:
                self._readable += self._script.pop(0)[1]
                self._say_unasked()
            elif self._script or data != self._last:
                self.wrong.append(data)
        return len(data)

    def close(self) -> None:
        self.closed = True

    def _say_unasked(self) -> None:
        while self._script and not self._script[0][0]:
            self._readable += self._script.pop(0)[1]

    def check(self) -> None:
        assert not self.wrong, f"the driver wrote {self.wrong}"
        assert not self._script, f"the driver left {self._script} of the script"
        assert not self._readable, f"the driver left {bytes(self._readable)!r} unread"
        assert not self.closed, "the driver closed a port that it did not open"


@contextmanager
def expected(*script: tuple[bytes, bytes]) -> Iterator[ScriptedPort]:
    port = ScriptedPort(list(script))
    yield port
    port.check()
