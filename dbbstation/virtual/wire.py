"""The virtual instrument and its end of the line. It answers as a protocol file states, at the line's speed."""

from __future__ import annotations

import random
import select
import socket
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.errors import InstrumentError
from dbbstation.instrument.codec import encode
from dbbstation.instrument.fields import Content
from dbbstation.system.pseudo_terminal import HAS_PTY, PtyEnd
from dbbstation.virtual.wire_clock import ScaledClock

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self

    from dbbstation.instrument.protocol import LineSettings, Protocol


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


End: TypeAlias = PtyEnd | SocketEnd
"""Device end of a virtual line."""


TOLERANCE = 0.04
"""Largest relative error of the baud rate: a UART samples the last of ten bits in its middle, so half a bit in ten,
minus some sampling error, is allowed."""


def heard_at(raw: bytes, line: LineSettings, *, sent_baud: int, heard_baud: int) -> bytes:
    """Return the bytes that a receiver at `heard_baud` reads if `raw` is sent at `sent_baud`."""
    if abs(heard_baud / sent_baud - 1.0) <= TOLERANCE:
        return raw
    bits = [bit for byte in raw for bit in _sent_bits(byte, line)]
    step = sent_baud / heard_baud  # of sent bits per received bit

    def level(at: float) -> int:
        return bits[int(at)] if at < len(bits) else 1

    heard = bytearray()
    at = 0.0
    while at < len(bits):
        if level(at) == 1:
            at = float(int(at) + 1)
            continue
        heard.append(sum(level(at + (1.5 + place) * step) << place for place in range(line.data_bits)))
        # The receiver looks for the next falling edge from the middle of the first stop bit on.
        at += (line.bits_per_character - line.stop_bits + 0.5) * step
        while at < len(bits) and level(at) == 0:
            at = float(int(at) + 1)
    return bytes(heard)


def _sent_bits(byte: int, line: LineSettings) -> list[int]:
    data = [byte >> place & 1 for place in range(line.data_bits)]
    parity = {"none": [], "even": [sum(data) % 2], "odd": [1 - sum(data) % 2]}[line.parity]
    return [0, *data, *parity, *[1] * line.stop_bits]


_TICK_S = 0.001
"""Interval of the polls while bytes are on the line, in real time [s]; bytes that are due in between are sent
together."""

_IDLE_S = 0.005
"""Interval of the polls while the line is quiet, in real time [s]; a request ends it at once."""

_BACKLOG = 4096
"""Greatest number of frames that wait for a slow program. The instrument then falls behind its clock and samples later,
with the length at the later time. Otherwise a busy computer would lose thousands of samples on a fast clock."""


_UNDER_WAY = 64
"""Number of frames on the line at which a waiting clock stops."""


@dataclass(slots=True)
class _Outgoing:
    raw: bytes
    start_s: float
    sent: int = 0


class VirtualInstrument:
    """A virtual length instrument; a `with` block switches it on and off.

    Args:
        length_mm_at: length at a virtual time [s]; None: no bar, reported as a fault. Called in the instrument's
            thread.
        clock: virtual time; None: real time.
        rate_hz: of a stream, instead of the protocol's.
        baud: rate of the device. A pseudo-terminal knows the other side's rate and garbles bytes if different.
        pty: use a pseudo-terminal, else a loopback socket.
        seed: of random latching times within bounds.
    """

    def __init__(
        self,
        protocol: Protocol,
        length_mm_at: Callable[[float], float | None],
        *,
        clock: ScaledClock | None = None,
        rate_hz: float | None = None,
        baud: int | None = None,
        pty: bool = HAS_PTY,
        seed: int = 0,
    ) -> None:
        self.protocol = protocol
        self.clock = clock or ScaledClock()
        self.port = ""
        self.unknown_bytes = 0
        self._length_mm_at = length_mm_at
        self._baud = baud or protocol.line.baud
        self._rate_hz = rate_hz or protocol.fastest_hz(self._baud)
        self._character_s = protocol.line.character_s(self._baud)
        self._pty = pty
        self._end: End | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._failure: Exception | None = None
        self._lock = threading.Lock()
        self._outgoing: deque[_Outgoing] = deque()
        self._incoming = b""
        self._running = not protocol.ask.start
        self._dice = random.Random(seed)  # noqa: S311 (no secret hangs on it)
        self._fault = False
        self._counter = 0
        self._next_sample_s = 0.0

    def start(self) -> None:
        """Open the line and switch on; sets `port`."""
        self._end = open_end(pty=self._pty)
        self.port = self._end.port
        self._stop.clear()
        self._next_sample_s = self.clock()
        self._thread = threading.Thread(target=self._run, args=(self._end,), name=f"virtual {self.port}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Switch the instrument off and close the line.

        Raises:
            Exception: from `length_mm_at`.
        """
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        self._thread = None
        if self._end is not None:
            self._end.close()
        self._end = None
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self, end: End) -> None:
        try:
            while not self._stop.is_set():
                raw = end.read() if end.wait(self._pause_s()) else b""
                self._hear(self._through_wrong_baud(raw, end, to_host=False))
                with self._lock:
                    now_s = self.clock()
                    if self.protocol.ask.mode == "stream":
                        self._sample(now_s, connected=end.connected)
                        self._transmit(end, now_s)
                    else:
                        self._transmit(end, self.clock.line_s())
                        self._incoming = self._incoming if end.connected else b""
                    if len(self._outgoing) < _UNDER_WAY:
                        self.clock.advance(asked=self.protocol.ask.asked)
        except Exception as error:  # noqa: BLE001 (raised again by `stop`, in the thread that can be told)
            self._failure = error

    def _pause_s(self) -> float:
        with self._lock:
            if self._outgoing:
                first = self._outgoing[0]
                due_s = first.start_s + len(first.raw) * self._character_s
                tick_s = _TICK_S
            elif self.protocol.ask.mode == "stream" and self._running:
                due_s, tick_s = self._next_sample_s, _IDLE_S
            else:
                return _IDLE_S
            if len(self._outgoing) >= _UNDER_WAY:
                return tick_s
            return min(max(self.clock.real_s(due_s - self.clock()), 0.0), tick_s)

    def _hear(self, raw: bytes) -> None:
        """Execute complete commands and drop other bytes."""
        ask = self.protocol.ask
        follow_up = b"" if ask.follow_up is None else ask.follow_up.request
        known = {ask.request, follow_up, *(step.send for step in ask.start + ask.stop)} - {b""}
        commands = sorted(known, key=len, reverse=True)
        with self._lock:
            self._incoming += raw
            while self._incoming:
                seen_s = self.clock()
                command = next((one for one in commands if self._incoming.startswith(one)), None)
                if command == ask.request and not self.clock.exchanges(1.0 / self._rate_hz):
                    return  # asked again when time goes on
                if command is not None:
                    self._incoming = self._incoming[len(command) :]
                    # On a real line the command takes this long to arrive.
                    self._obey(command, seen_s + len(command) * self._character_s)
                elif any(one.startswith(self._incoming) for one in commands):
                    return
                else:
                    self._incoming = self._incoming[1:]
                    self.unknown_bytes += 1

    def _obey(self, command: bytes, now_s: float) -> None:
        ask, timing = self.protocol.ask, self.protocol.timing
        replied_s = now_s + timing.reply_latency_s
        for step in (*ask.stop, *ask.start):
            if step.send == command:
                self._send(step.reply, replied_s)
                begins = bool(ask.start) and ask.start[-1].send == command
                if step in ask.stop:
                    self._running &= begins
                elif begins:
                    self._running, self._next_sample_s = True, now_s
                return
        if ask.follow_up is not None and ask.follow_up.request == command:
            # What explains a fault comes first, that there is none to explain last.
            frame = ask.follow_up.frames[0 if self._fault else -1]
            self._send(frame.write(Content(0.0)), replied_s)
            return
        if self._running:
            self._send_sample(now_s + self._dice.uniform(*self.protocol.latch_bounds_s()), replied_s)

    def _sample(self, now_s: float, *, connected: bool) -> None:
        """Take the due samples of a stream; they are lost if no program listens."""
        while self._running and self._next_sample_s <= now_s and not (connected and len(self._outgoing) >= _BACKLOG):
            at_s = self._next_sample_s
            self._next_sample_s += 1.0 / self._rate_hz
            if connected:
                self._send_sample(at_s, at_s + self.protocol.timing.latch_delay_s)
            else:
                self._counter += 1

    def _send_sample(self, at_s: float, start_s: float) -> None:
        counter, self._counter = self._counter, self._counter + 1
        raw = b""
        # A device without a way to say that it has no value says nothing.
        with suppress(InstrumentError):
            length_mm = self._length_mm_at(at_s)
            self._fault = length_mm is None
            raw = encode(self.protocol, length_mm, counter=counter)
        self._send(raw, start_s)

    def _send(self, raw: bytes, start_s: float) -> None:
        if not raw:
            return
        if self._outgoing:
            last = self._outgoing[-1]
            start_s = max(start_s, last.start_s + len(last.raw) * self._character_s)
        self._outgoing.append(_Outgoing(raw, start_s))

    def _transmit(self, end: End, now_s: float) -> None:
        """Write the due bytes; they are lost if no program listens."""
        while self._outgoing:
            first = self._outgoing[0]
            due = int(min(len(first.raw), (now_s - first.start_s) / self._character_s + 1e-6))
            if due > first.sent:
                raw = first.raw[first.sent : due]
                if end.connected:
                    garbled = self._through_wrong_baud(raw, end, to_host=True)
                    taken = end.write(garbled) if garbled is raw else len(raw) if end.write(garbled) >= 0 else 0
                else:
                    taken = len(raw)
                first.sent += taken
                if taken < len(raw):
                    return
            if first.sent < len(first.raw):
                return
            self._outgoing.popleft()

    def _through_wrong_baud(self, raw: bytes, end: End, *, to_host: bool) -> bytes:
        host_baud = end.host_baud()
        if host_baud is None or not raw:
            return raw
        sent, heard = (self._baud, host_baud) if to_host else (host_baud, self._baud)
        return heard_at(raw, self.protocol.line, sent_baud=sent, heard_baud=heard)
