"""An instrument that stays open for the checklist, the bar and the circles."""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.instrument.driver import Instrument
from dbbstation.service.patience import RECONNECT_S, driver_patience
from dbbstation.service.reading_rate import ReadingRate
from dbbstation.station.run_record import unrecorded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.station.events import Sample

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
