"""Decode a byte log in the same way as a live line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.errors import InstrumentError
from dbbstation.instrument.codec import Decoder
from dbbstation.instrument.doubt import Doubts, Piece
from dbbstation.instrument.sequence import SampleOrder

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dbbstation.instrument.bytelog import Chunk
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading


@dataclass(frozen=True, slots=True)
class Replayed:
    """A reading or rejected bytes of a byte log.

    Attributes:
        t_s: last byte, since the log was opened.
        reading: None if not understood.
    """

    t_s: float
    raw: bytes
    reading: Reading | None
    why: str = ""


def replayed(protocol: Protocol, chunks: Iterable[Chunk], *, where: str) -> Iterator[Replayed]:
    """Yield readings and rejected bytes in wire order."""
    decoding = _Decoding(protocol, where)
    for chunk in chunks:
        yield from decoding.sent(chunk.raw) if chunk.direction == ">" else decoding.came(chunk)
    yield from decoding.ended()


class _Decoding:
    """State of decoding a log."""

    def __init__(self, protocol: Protocol, where: str) -> None:
        self._protocol = protocol
        self._where = where
        self._answers = {step.reply for step in (*protocol.ask.start, *protocol.ask.stop) if step.reply}
        self._decoder = Decoder(protocol, joining=not protocol.ask.asked)
        self._sequence = self._anew()
        self._doubts = Doubts(protocol)
        self._answer = b""
        self._explaining = False
        self._last_s = 0.0

    def sent(self, raw: bytes) -> Iterator[Replayed]:
        """Process bytes that were sent to the device; they end the previous reply."""
        if not self._protocol.ask.asked:
            return
        yield from self._unfinished("no end before the next request")
        self._answer = b""
        follow_up = self._protocol.ask.follow_up
        self._explaining = follow_up is not None and raw == follow_up.request
        told = self._protocol.explaining if self._explaining else None
        self._decoder = Decoder(told or self._protocol, joining=False)

    def came(self, chunk: Chunk) -> Iterator[Replayed]:
        """Process bytes from the device."""
        self._last_s = chunk.t_s
        self._answer += chunk.raw if self._protocol.ask.asked else b""
        for heard in self._decoder.feed(chunk.raw):
            if isinstance(heard, Piece):
                if not self._explaining:
                    yield from self._placed(heard)
            elif heard.raw not in self._answers:
                yield Replayed(chunk.t_s, heard.raw, None, "joined in the middle" if heard.joining else heard.why)

    def ended(self) -> Iterator[Replayed]:
        """Return the pending bytes at the end of the log."""
        for one in self._sequence.left():
            yield Replayed(one.sample[1], one.sample[0].raw, None, one.why)
        yield from self._unfinished("the log ends within it")

    def _placed(self, heard: Piece) -> Iterator[Replayed]:
        clean = heard.raw == self._answer or not self._protocol.ask.asked
        heard = replace(heard, reading=self._doubts.judged(heard, clean=clean))
        try:
            placed = self._sequence.place(heard.reading.counter, (heard, self._last_s))
        except InstrumentError as error:
            for one in self._sequence.left():
                yield Replayed(one.sample[1], one.sample[0].raw, None, error.what)
            self._sequence = self._anew()
            placed = self._sequence.place(heard.reading.counter, (heard, self._last_s))
        for one in placed:
            piece, t_s = one.sample
            told = None if one.lost is None else replace(piece.reading, t_s=t_s, lost=one.lost)
            yield Replayed(t_s, piece.raw, told, one.why)

    def _unfinished(self, why: str) -> Iterator[Replayed]:
        raw = self._decoder.take_pending()
        if raw and raw not in self._answers:
            yield Replayed(self._last_s, raw, None, why)

    def _anew(self) -> SampleOrder[tuple[Piece, float]]:
        return SampleOrder(self._protocol.counter_modulus, self._where)
