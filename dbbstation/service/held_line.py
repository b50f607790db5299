"""An instrument that stays open for the checklist, the bar and the circles; its rate and its waiting limits."""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

from dbbstation.errors import StationError
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.link import connected_ports
from dbbstation.station.run_record import unrecorded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.station.events import Sample

RECONNECT_S = 30.0
"""Time that a measurement waits for an unplugged adapter, so that a person can notice and reconnect it [s]."""

_MEMORY_S = 2.0
"""Time for which the driver remembers the fastest arrival of samples [s]; in a longer time the instrument's clock
drifts."""

_SCALED_MEMORY_S, _SCALED_TIMEOUT_S = 60.0, 5.0
"""Memory of the fastest arrival and patience with a silent line on scaled time [s of real time]. On scaled time a short
pause of the computer is a long time."""


_WAITING_TIMEOUT_S = 600.0
"""Patience with a machine that waits [s]: it is silent while runs are judged. If its program ends, the line closes at
once."""


class DriverPatience(TypedDict):
    """Arguments of `Instrument`."""

    memory_s: float
    timeout_s: float | None


def driver_patience(time_scale: float, *, waits: bool = False) -> DriverPatience:
    """Return arguments of `Instrument` on a clock `time_scale` times as fast as real time."""
    if waits:
        return {"memory_s": _MEMORY_S, "timeout_s": _WAITING_TIMEOUT_S}
    if time_scale == 1.0:
        return {"memory_s": _MEMORY_S, "timeout_s": None}
    return {"memory_s": _SCALED_MEMORY_S * time_scale, "timeout_s": _SCALED_TIMEOUT_S}


_WINDOW_S = 2.0
"""Time over which readings are counted [s]: enough for a few readings per second, and short enough to follow a
change."""

_FEWEST = 3


class ReadingRate:
    """Counts samples over the last seconds of their own time."""

    def __init__(self) -> None:
        self._batches: deque[tuple[float, int]] = deque()
        self.total = 0

    def add(self, samples: Sequence[Sample]) -> None:
        """Count samples in time order; a changed clock resets the count."""
        last_s = samples[-1].t_s
        if self._batches and not 0.0 <= samples[0].t_s - self._batches[-1][0] <= _WINDOW_S:
            self._batches.clear()
        self._batches.append((last_s, len(samples)))
        self.total += len(samples)
        while len(self._batches) > _FEWEST and self._batches[0][0] < last_s - _WINDOW_S:
            self._batches.popleft()

    def forget(self) -> None:
        """Reset for another line."""
        self._batches.clear()

    @property
    def per_s(self) -> float | None:
        """Return readings per second; None for too few."""
        if len(self._batches) < _FEWEST:
            return None
        span_s = self._batches[-1][0] - self._batches[0][0]
        return (sum(count for _, count in self._batches) - self._batches[0][1]) / span_s if span_s > 0.0 else None


_TICK_S = 0.05
"""Interval of readings while no other part reads the instrument [s]: as often as a person can read a display."""

AGAIN_S = 2.0
"""Time after which an instrument without an answer is opened again [s]."""

_KEPT = 4096
"""Number of kept samples: more than a second of the fastest instrument, so that its rate can be computed."""

_JOIN_S = 10.0
"""Longest wait for a serial line that hangs in the operating system [s]."""


class HeldLine:
    """Keeps an instrument open until it is closed.

    Attributes:
        latest: None before a reading and during failure.
    """

    def __init__(
        self,
        protocol: Protocol,
        port: str,
        baud: int | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        time_scale: float = 1.0,
        log: ByteLog | None = None,
    ) -> None:
        self.protocol = protocol
        self.latest: Sample | None = None
        self.failure: StationError | None = None
        self.rate = ReadingRate()
        self._port, self._baud = port, baud
        self._instrument = Instrument(
            protocol, port, baud=baud, clock=clock, log=log, reconnect_s=RECONNECT_S, **driver_patience(time_scale)
        )
        self._turn = threading.Lock()
        self._seen: deque[Sample] = deque(maxlen=_KEPT)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"hold {port}", daemon=True)
        self._thread.start()

    def is_of(self, protocol: Protocol, port: str, baud: int | None) -> bool:
        """Return whether the held instrument has this protocol, port and baud rate."""
        return (protocol, port, baud) == (self.protocol, self._port, self._baud)

    @contextmanager
    def lent(self) -> Iterator[Instrument]:
        """Lend the started instrument to one borrower.

        Raises:
            InstrumentError: it cannot be opened.
        """
        with self._turn:
            self._ready()
            with suppress(StationError):  # a failure of this moment meets whoever reads
                self._instrument.drain()
            self._seen.clear()
            yield self._instrument

    def seen(self) -> tuple[Sample, ...]:
        """Return readings since the last call while not lent."""
        came = []
        with suppress(IndexError):
            while True:
                came.append(self._seen.popleft())
        return tuple(came)

    def close(self) -> None:
        """Close the instrument after its return."""
        self._stop.set()
        self._thread.join(_JOIN_S)

    def _run(self) -> None:
        while not self._stop.wait(_TICK_S):
            with self._turn:
                try:
                    self._look()
                except StationError as error:
                    self.failure, self.latest = error, None
                    self.rate.forget()
            if self.failure is not None:
                self._stop.wait(AGAIN_S)
        with self._turn, suppress(StationError):
            self._instrument.close()

    def _look(self) -> None:
        self._ready()
        samples = [unrecorded(reading) for reading in self._instrument.drain()]
        if samples:
            self.failure, self.latest = None, samples[-1]
            self.rate.add(samples)
            self._seen.extend(samples)

    def _ready(self) -> None:
        if not self._instrument.reading:
            with suppress(StationError):
                self._instrument.close()
            self._instrument.start()


class HeldOpen:
    """At most one open instrument."""

    def __init__(self) -> None:
        self._line: HeldLine | None = None

    def line(self, protocol: Protocol, port: str, baud: int | None) -> HeldLine:
        """Return the instrument, and close another one first."""
        if self._line is None or not self._line.is_of(protocol, port, baud):
            self.release()
            self._line = HeldLine(protocol, port, baud)
        return self._line

    def release(self) -> None:
        """Close the held instrument."""
        line, self._line = self._line, None
        if line is not None:
            line.close()


PATIENCE_S = 4.0
"""Longest wait for a reading [s]: a display answers within a tenth of a second, and a stream needs no request."""

_LOOK_S = 0.02


@dataclass(frozen=True)
class ProbeOutcome:
    """The answer at a port.

    Attributes:
        text: reading, status, or fault with remedy.
    """

    port: str
    answers: bool
    text: str


def ports() -> list[tuple[str, str]]:
    """Return name and description of every serial port."""
    return [(name, description) for name, description, _ in connected_ports()]


def probe(protocol: Protocol, port: str, baud: int | None = None, patience_s: float = PATIENCE_S) -> ProbeOutcome:
    """Ask a port for a reading of an instrument."""
    try:
        with Instrument(protocol, port, baud=baud, timeout_s=patience_s) as source:
            end_s = time.monotonic() + patience_s
            while time.monotonic() < end_s:
                readings = source.drain()
                if readings:
                    last = readings[-1]
                    if last.length_mm is not None:
                        return ProbeOutcome(port, answers=True, text=f"{last.length_mm:.4f} mm")
                    return ProbeOutcome(port, answers=True, text=f"no bar: {last.said or last.status}")
                time.sleep(_LOOK_S)
    except StationError as error:
        return ProbeOutcome(port, answers=False, text=f"{error.what}; {error.remedy}" if error.remedy else error.what)
    return ProbeOutcome(port, answers=False, text="nothing came")
