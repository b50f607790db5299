"""The virtual machine's control address, loopback only. The server reads lines of text and answers in lines of JSON."""

from __future__ import annotations

import json
import re
import socket
import threading
from contextlib import suppress
from socketserver import StreamRequestHandler, ThreadingTCPServer
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from dbbstation.errors import MachineError, StationError
from dbbstation.plan.plan import Direction

if TYPE_CHECKING:
    from collections.abc import Callable
    from io import BufferedIOBase
    from typing import Self

    from dbbstation.virtual.cell import VirtualCell
    from dbbstation.virtual.machine import CommandedPath

    Programs = Callable[[str], CommandedPath]

LOOPBACK = "127.0.0.1"
SCHEME = "tcp://"

_TICK_S = 0.05
_LONGEST = 4096
"""Greatest number of bytes of a line; longer lines are refused."""


class CellCommands:
    """Executes the protocol's commands."""

    def __init__(self, cell: VirtualCell, programs: Programs | None = None) -> None:
        self._cell = cell
        self._programs = programs
        self.quit = threading.Event()

    def __call__(self, line: str) -> dict[str, object]:
        """Execute one line and return the answer.

        Raises:
            StationError: the line cannot be obeyed.
        """
        match line.split():
            case ["mount", test]:
                return {"mounting": self._cell.mount(test)}
            case ["start", test, direction, *program] if direction in set(Direction) and len(program) <= 1:
                run = self._cell.start(test, Direction(direction), self._path(program))
                return {"mounting": run.mounting, "duration_s": round(run.path.duration_s, 3)}
            case ["calibrator", length] if re.fullmatch(r"[0-9]{1,4}(\.[0-9]{1,9})?", length):
                self._cell.calibrate(float(length))
            case ["status"]:
                return self._cell.status()
            case ["truth"]:
                return self._cell.machine.describe()
            case ["stop"]:
                self._cell.stop()
            case ["quit"]:
                self.quit.set()
            case _:
                remedy = "mount TEST, start TEST ccw|cw [PROGRAM], calibrator LENGTH_MM, status, truth, stop, quit"
                raise MachineError(f"`{line}` is no command", where="virtual machine", remedy=remedy)
        return {}

    def _path(self, program: list[str]) -> CommandedPath | None:
        if not program:
            return None
        if self._programs is None:
            raise MachineError("it has no programs", where="virtual machine", remedy="start `emulate` with --programs")
        return self._programs(program[0])


class _Line(StreamRequestHandler):
    """Answers the commands of one client."""

    server: ControlServer

    def handle(self) -> None:
        """Answer until the client closes, or sends a line that does not end."""
        with suppress(OSError):
            while (line := self.rfile.readline(_LONGEST)).endswith(b"\n"):
                self.server.answer(line, self.wfile)


class ControlServer(ThreadingTCPServer):
    """Answers on a loopback port, one command at a time; a `with` block."""

    def __init__(self, obey: Callable[[str], dict[str, object]]) -> None:
        super().__init__((LOOPBACK, 0), _Line)
        self._obey, self._one_at_a_time = obey, threading.Lock()
        self._clients: list[socket.socket] = []
        self.url = f"{SCHEME}{LOOPBACK}:{self.server_address[1]}"
        self._thread = threading.Thread(target=self.serve_forever, args=(_TICK_S,), name="control", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self._thread.join()
        with self._one_at_a_time:  # the answer to the last command is sent first
            for client in self._clients:
                with suppress(OSError):  # it has gone
                    client.shutdown(socket.SHUT_RDWR)
        self.server_close()

    def get_request(self) -> tuple[socket.socket, object]:
        """Accept a client, and keep it to be closed."""
        client, address = super().get_request()
        self._clients = [one for one in self._clients if one.fileno() >= 0] + [client]
        return client, address

    def answer(self, line: bytes, client: BufferedIOBase) -> None:
        """Execute one command, and send the answer, a line of JSON."""
        with self._one_at_a_time:
            try:
                found = {"ok": True, **self._obey(line.decode("utf-8", "replace").strip())}
            except StationError as error:
                found = {"ok": False, "error": str(error)}
            client.write(json.dumps(found).encode() + b"\n")


_PATIENCE_S = 30.0
"""Longest wait for an answer [s]: the first run on a new computer waits for the compiler."""

_LOCAL = {"127.0.0.1", "localhost"}


class ControlClient:
    """Sends one command per connection.

    Args:
        url: such as `tcp://127.0.0.1:41234`.

    Raises:
        MachineError: no such address, or the address of another computer.
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
            with socket.create_connection(self._address, timeout=_PATIENCE_S) as line, line.makefile("rb") as answers:
                line.sendall((" ".join(words) + "\n").encode())
                answer: dict[str, object] = json.loads(answers.readline())
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
            MachineError: no answer.
        """
        if self.ask("status").get("state") == "running":
            self.ask("stop")
