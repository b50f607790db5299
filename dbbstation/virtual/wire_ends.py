"""The instrument's end of a line: pseudo-terminal or loopback socket."""

from __future__ import annotations

import select
import socket
from typing import Protocol

from dbbstation.system.pseudo_terminal import HAS_PTY, PtyEnd


class End(Protocol):
    """A line for the virtual instrument."""

    port: str
    """Name of the other end, which a program opens."""

    @property
    def connected(self) -> bool:
        """Return whether a program is connected, as of the last `wait` or `read`."""

    def wait(self, real_s: float) -> bool:
        """Wait for bytes; return whether there are any."""

    def read(self) -> bytes:
        """Return the bytes that have arrived."""

    def write(self, raw: bytes) -> int:
        """Send what the line takes; return the number of bytes."""

    def host_baud(self) -> int | None:
        """Return the other side's rate, or None."""

    def close(self) -> None:
        """Close the line, as if unplugged."""


def open_end(*, pty: bool = HAS_PTY) -> End:
    """Return the instrument's end of a new line."""
    return PtyEnd() if pty else SocketEnd()


class SocketEnd:
    """A socket on the loopback address; one program at a time."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0), backlog=1)
        self._server.settimeout(0.0)
        self._client: socket.socket | None = None
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"

    @property
    def connected(self) -> bool:
        """Return whether a program is connected."""
        return self._client is not None

    def wait(self, real_s: float) -> bool:
        """Wait for bytes; return whether there are any."""
        ready = select.select([self._client or self._server], [], [], real_s)[0]
        if ready and self._client is None:
            self._client, _ = self._server.accept()
            self._client.settimeout(0.0)
            # Each byte at its time, not collected.
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return False
        return bool(ready)

    def read(self) -> bytes:
        """Return the bytes that have arrived."""
        if self._client is None:
            return b""
        try:
            raw = self._client.recv(4096)
        except BlockingIOError:
            return b""
        except ConnectionError:
            raw = b""
        if not raw:
            self._client.close()
            self._client = None
        return raw

    def write(self, raw: bytes) -> int:
        """Send what the line takes; return the number of bytes."""
        if self._client is None:
            return len(raw)
        try:
            return self._client.send(raw)
        except BlockingIOError:
            return 0
        except ConnectionError:
            return len(raw)

    def host_baud(self) -> int | None:
        """Return None: a socket has no rate."""
        return None

    def close(self) -> None:
        """Close the line."""
        if self._client is not None:
            self._client.close()
        self._client = None
        self._server.close()
