"""The driver reads an instrument through a port by its protocol."""

from __future__ import annotations

import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.errors import InstrumentError, StationError
from dbbstation.instrument import symptoms
from dbbstation.instrument.codec import LONGEST_LINE, Decoder, Garbage
from dbbstation.instrument.doubt import Doubts, Piece
from dbbstation.instrument.link import LineClosedError, adapter_of, name_of, open_link, port_of
from dbbstation.instrument.polling import Poller
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.instrument.reception import INCOMPLETE, Reception, Tally
from dbbstation.instrument.sequence import SampleOrder
from dbbstation.instrument.stamps import MachineTime, StreamStamps
from dbbstation.system.handles import Closing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import Self

    from serial.tools.list_ports_common import ListPortInfo

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.link import Link, Port
    from dbbstation.instrument.protocol import LineCommand, Protocol
    from dbbstation.instrument.reading import Reading


class Listener:
    """Reads a streaming instrument until stopped; only a long silence is an error."""

    def __init__(self, link: Link, reception: Reception) -> None:
        protocol = reception.protocol
        self._link = link
        self._to = reception
        self._sequence = SampleOrder[tuple[Piece, float]](protocol.counter_modulus, reception.where)
        # Behind the answer to a start command the stream begins with a whole frame.
        self._decoder = Decoder(protocol, joining=not (protocol.ask.start and protocol.ask.start[-1].reply))
        self._stamps = (
            reception.clock
            if isinstance(reception.clock, MachineTime)
            else StreamStamps(1.0 / protocol.fastest_hz(reception.baud), reception.memory_s)
        )
        self._doubts = Doubts(protocol)
        self._good_s = time.monotonic()
        self._garbled, self._unread, self._why = 0, b"", ""

    def run(self, chunk: bytes) -> None:
        """Read until `stop` is set.

        Raises:
            InstrumentError: the line is silent, closed or garbled, or the device restarted; OutputError: the byte log is full.
        """
        while not self._to.stop.is_set():
            chunk += self._link.read()
            seen_s = self._to.clock()
            for heard in self._decoder.feed(chunk) if chunk else ():
                if isinstance(heard, Garbage):
                    self._pass_over(heard)
                else:
                    self._take(heard, seen_s)
            chunk = b""
            if time.monotonic() - self._good_s > self._to.timeout_s:
                raise self._to.symptom(self._unread or self._decoder.pending, self._why if self._unread else INCOMPLETE)

    def _pass_over(self, heard: Garbage) -> None:
        if heard.joining:
            return
        self._to.tally.reject(heard.raw, heard.reason)
        self._garbled += max(1, round(len(heard.raw) / self._to.protocol.frame_characters))
        self._unread, self._why = (self._unread + heard.raw)[:LONGEST_LINE], heard.why

    def _take(self, heard: Piece, seen_s: float) -> None:
        size = heard.after + len(heard.raw)
        left_s = seen_s - size * self._to.character_s - self._to.protocol.timing.latch_delay_s
        judged = self._doubts.judged(heard)
        heard = heard if judged is heard.reading else replace(heard, reading=judged)
        for placed in self._sequence.place(heard.reading.counter, (heard, left_s)):
            piece, sent_s = placed.sample
            if placed.lost is None:
                self._to.tally.reject(piece.raw, "counter")
                self._unread, self._why = (self._unread + piece.raw)[:LONGEST_LINE], placed.why
                continue
            lost = placed.lost if self._sequence.counts else self._garbled
            self._to.put(replace(piece.reading, t_s=self._stamps.stamp(sent_s, lost), lost=lost))
            self._good_s = time.monotonic()
            self._garbled, self._unread, self._why = 0, b"", ""


_LOOK_S = 0.25
"""Interval of the search for an unplugged adapter [s]."""

_JOIN_S = 5.0
"""Longest wait for the end of the reader thread [s]; it usually ends within some hundredths of a second."""


class Instrument(Closing):
    """A length instrument on a serial line; a `with` block starts and closes it.

    Args:
        clock: monotonic, for readings [s]; scaled for virtual instruments, while patience is in real seconds.
        log: log of all bytes; the caller closes it.
        timeout_s: real seconds until a silent line is an error; None: the protocol's.
        memory_s: how long a stream's quickest arrival counts, by `clock`: longer on a scaled clock, since delays are in real
            time.
        reconnect_s: real seconds to wait for an unplugged USB adapter, known by its identity.
    """

    def __init__(
        self,
        protocol: Protocol,
        port: str | Port,
        *,
        baud: int | None = None,
        clock: Callable[[], float] = time.monotonic,
        log: ByteLog | None = None,
        timeout_s: float | None = None,
        memory_s: float = 2.0,
        reconnect_s: float = 0.0,
    ) -> None:
        self.protocol = protocol
        self._port = port
        self._log = log
        self._reconnect_s = reconnect_s
        self._adapter: ListPortInfo | None = None
        self._last_s: float | None = None
        self._away = False
        self._link: Link | None = None
        self._thread: threading.Thread | None = None
        self._arrived = threading.Condition()
        self._queue: deque[Reading] = deque()
        self._failure: StationError | None = None
        self._to = Reception(
            protocol=protocol,
            where=name_of(port),
            baud=baud or protocol.line.baud,
            clock=clock,
            timeout_s=timeout_s or protocol.timing.timeout_s,
            memory_s=memory_s,
            put=self._put,
        )

    @property
    def where(self) -> str:
        """Return the name of the port."""
        return self._to.where

    @property
    def tally(self) -> Tally:
        """Return the counts since `start`."""
        return self._to.tally

    @property
    def sees_damage(self) -> bool:
        """Return whether wrong parity or stop bits are detected."""
        return self._link is not None and self._link.sees_damage

    @property
    def reading(self) -> bool:
        """Return whether the line is read: false before `start` and after failure."""
        return self._thread is not None and self._thread.is_alive() and self._failure is None

    def start(self) -> None:
        """Open the line, send the start sequence and read.

        Raises:
            InstrumentError: the port does not open, or the start sequence gets no answer.
        """
        if self._thread is not None:
            raise InstrumentError("the instrument is already being read", where=self.where, remedy="stop it first")
        self._link = self._link or self._open(self._port)
        self._adapter = adapter_of(self._port) if self._reconnect_s and isinstance(self._port, str) else None
        self._last_s, self._away = None, False
        self._to.stop.clear()
        self._queue.clear()
        self._failure = None
        self._to.tally = Tally()
        try:
            after = self._begin(self._link)
        except StationError:
            self.close()
            raise
        self._thread = threading.Thread(
            target=self._run, args=(self._link, after), name=f"read {self.where}", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop reading and send the stop sequence; line and unread readings stay.

        Raises:
            InstrumentError: the stop sequence gets no answer.
        """
        if self._thread is None:
            return
        self._to.stop.set()
        self._thread.join(_JOIN_S)
        if self._thread.is_alive():
            raise InstrumentError(
                "the reader does not end: the port hangs", where=self.where, remedy="unplug the adapter"
            )
        self._thread = None
        if self._link is not None and self._failure is None:
            for step in self.protocol.ask.stop:
                _command(self._link, step, self._to.timeout_s)

    def close(self) -> None:
        """Stop and close the line; a given open port and unread readings stay."""
        try:
            self.stop()
        finally:
            if self._link is not None:
                self._link.close()
            self._link = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def read(self) -> Reading:
        """Wait for the next reading and return it.

        Raises:
            InstrumentError: the line is silent, closed, garbled or stopped; OutputError: the byte log is full. Earlier readings
                come first.
        """
        with self._arrived:
            while not self._queue:
                if self._failure is not None:
                    raise self._failure
                if self._thread is None or not self._thread.is_alive():
                    raise InstrumentError("the instrument is not being read", where=self.where, remedy="start it first")
                # Woken by each reading; the limit is for a thread that ended in between.
                self._arrived.wait(0.1)
            return self._queue.popleft()

    def unreadable(self) -> dict[str, int]:
        """Return counts of rejected bytes since `start`, by fault."""
        return {str(reason): count for reason, count in self.tally.rejected.items()}

    def drain(self) -> list[Reading]:
        """Return unread readings without waiting."""
        with self._arrived:
            readings = list(self._queue)
            self._queue.clear()
            if not readings and self._failure is not None:
                raise self._failure
            return readings

    def readings(self, count: int | None = None) -> Iterator[Reading]:
        """Yield `count` readings, or without end."""
        done = 0
        while count is None or done < count:
            yield self.read()
            done += 1

    def _open(self, port: str | Port) -> Link:
        protocol = self.protocol
        return open_link(port, protocol.line, baud=self._to.baud, log=self._log, text=protocol.is_text)

    def _begin(self, link: Link) -> bytes:
        after = b""
        for step in self.protocol.ask.start:
            after = _command(link, step, self._to.timeout_s)
        return after

    def _run(self, link: Link, after: bytes) -> None:
        try:
            while not self._to.stop.is_set():
                try:
                    self._read_on(link, after)
                except LineClosedError as error:
                    found = self._plugged_in_again()
                    if found is None:
                        raise error from None
                    link, after = found
        except StationError as error:
            self._end(error)
        except Exception as error:  # noqa: BLE001 (a thread that dies silently would look like a silent instrument)
            self._end(InstrumentError(f"reading failed: {type(error).__name__}: {error}", where=self.where))

    def _read_on(self, link: Link, after: bytes) -> None:
        self._to.eighth_bit_marks = link.eighth_bit_marks
        if self.protocol.ask.asked:
            self.tally.reject(after, "bytes")
            Poller(link, self._to).run()
        else:
            Listener(link, self._to).run(after)

    def _plugged_in_again(self) -> tuple[Link, bytes] | None:
        if self._adapter is None:
            return None
        if self._link is not None:
            self._link.close()
        end_s = time.monotonic() + self._reconnect_s
        while time.monotonic() < end_s and not self._to.stop.wait(_LOOK_S):
            name = port_of(self._adapter)
            if name is None:
                continue
            # A port that has just appeared may not be ready, or not be ours yet: it is tried again.
            with suppress(StationError):
                link = self._open(name)
                self._link, self._away = link, True
                self.tally.reconnected += 1
                return link, self._begin(link)
        return None

    def _put(self, reading: Reading) -> None:
        if self._away and self._last_s is not None:
            # Nobody counted while the cable was out: the clock did.
            missed = round((reading.t_s - self._last_s) * self.protocol.fastest_hz(self._to.baud)) - 1
            reading = replace(reading, lost=max(reading.lost, missed, 1))
        self._away, self._last_s = False, reading.t_s
        with self._arrived:
            self.tally.readings += 1
            self.tally.lost += reading.lost
            self.tally.doubtful += reading.status == DOUBTFUL
            self._queue.append(reading)
            self._arrived.notify_all()

    def _end(self, failure: StationError) -> None:
        with self._arrived:
            self._failure = failure
            self._arrived.notify_all()


def _command(link: Link, step: LineCommand, patience_s: float) -> bytes:
    link.write(step.send)
    came = b""
    deadline_s = time.monotonic() + patience_s
    while step.reply and step.reply not in came:
        if step.refused and step.refused in came:
            raise InstrumentError(
                f"the instrument refuses the command {symptoms.shown(step.send)}",
                where=link.name,
                remedy="check instrument, profile, and that its display shows the actual value",
            )
        if time.monotonic() > deadline_s:
            answer = symptoms.shown(came) if came else "nothing"
            raise InstrumentError(
                f"to the command {symptoms.shown(step.send)} came {answer} instead of {symptoms.shown(step.reply)}",
                where=link.name,
                remedy="check that it is this instrument, switched on and set to this baud rate",
            )
        came += link.read()
    time.sleep(step.wait_s)
    return came.partition(step.reply)[2] if step.reply else b""
