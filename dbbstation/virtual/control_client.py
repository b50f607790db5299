"""Client of a virtual machine's control address."""

from __future__ import annotations

import json
import socket
from urllib.parse import urlsplit

from dbbstation.errors import MachineError

_PATIENCE_S = 30.0
"""Longest wait for an answer [s]: the first run on a new computer waits for the compiler."""

_LOCAL = {"127.0.0.1", "localhost"}


class ControlClient:
    """Sends one command per connection.

    Args:
        url: such as `tcp://127.0.0.1:41234`.

    Raises:
        MachineError: no such address, or another computer, whose machine nobody watches.
    """

    def __init__(self, url: str) -> None:
        parts = urlsplit(url if "//" in url else f"//{url}")
        try:
            port = parts.port
        except ValueError:
            port = None
        if parts.hostname not in _LOCAL or not port:
            raise MachineError(
                "this is no control address of a virtual machine on this computer",
                where=url,
                remedy="give the one that `dbbstation instrument emulate` prints, such as tcp://127.0.0.1:41234",
            )
        self.url = url
        self._address = ("127.0.0.1", port)

    def ask(self, *words: str) -> dict[str, object]:
        """Send a command, return its answer.

        Raises:
            MachineError: no answer, or a refusal.
        """
        try:
            with socket.create_connection(self._address, timeout=_PATIENCE_S) as line:
                line.sendall((" ".join(words) + "\n").encode())
                came = b""
                while not came.endswith(b"\n"):
                    chunk = line.recv(65536)
                    if not chunk:
                        break
                    came += chunk
            answer: dict[str, object] = json.loads(came)
        except (OSError, ValueError) as error:
            raise MachineError(
                f"the virtual machine does not answer `{' '.join(words)}`: {error}",
                where=self.url,
                remedy="is `dbbstation instrument emulate` still running?",
            ) from None
        if not answer.get("ok"):
            raise MachineError(str(answer.get("error", "it refuses")), where=self.url)
        return answer

    def free(self) -> None:
        """Stop a run whose program has ended.

        Raises:
            MachineError: nobody answers.
        """
        if self.ask("status").get("state") == "running":
            self.ask("stop")
