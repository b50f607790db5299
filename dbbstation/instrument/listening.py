"""Read an instrument that sends by itself."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.instrument.arrivals import Arrivals
from dbbstation.instrument.codec import LONGEST_LINE, Decoder, Garbage
from dbbstation.instrument.doubt import Doubts, Piece
from dbbstation.instrument.reception import INCOMPLETE
from dbbstation.instrument.sequence import SampleOrder
from dbbstation.instrument.stamps import MachineTime, StreamStamps

if TYPE_CHECKING:
    from dbbstation.instrument.link import Link
    from dbbstation.instrument.reception import Reception


class Listener:
    """Takes readings until stopped; only a long silence is an error."""

    def __init__(self, link: Link, reception: Reception) -> None:
        protocol = reception.protocol
        self._link = link
        self._to = reception
        self._sequence = SampleOrder[tuple[Piece, float, float]](protocol.counter_modulus, reception.where)
        # Behind the answer to a start command the stream begins with a whole frame.
        self._decoder = Decoder(protocol, joining=not (protocol.ask.start and protocol.ask.start[-1].reply))
        self._stamps = (
            reception.clock
            if isinstance(reception.clock, MachineTime)
            else StreamStamps(1.0 / protocol.fastest_hz(reception.baud), reception.memory_s)
        )
        self._doubts = Doubts(protocol)
        self._arrivals = Arrivals(reception.character_s, 2 * LONGEST_LINE)
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
            self._arrivals.note(len(chunk), seen_s)
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
        sample = (heard, left_s, self._arrivals.at_latest_s(size - 1))
        for placed in self._sequence.place(heard.reading.counter, sample):
            piece, sent_s, first_s = placed.sample
            if placed.lost is None:
                self._to.tally.reject(piece.raw, "counter")
                self._unread, self._why = (self._unread + piece.raw)[:LONGEST_LINE], placed.why
                continue
            lost = placed.lost if self._sequence.counts else self._garbled
            self._to.put(replace(piece.reading, t_s=self._stamps.stamp(sent_s, lost), lost=lost, first_byte_s=first_s))
            self._good_s = time.monotonic()
            self._garbled, self._unread, self._why = 0, b"", ""
