"""A byte log through the same decoder as the live line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.errors import InstrumentError
from dbbstation.instrument.codec import Decoder, GapCounter, Garbage

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dbbstation.instrument.bytelog import Chunk
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading


@dataclass(frozen=True, slots=True)
class Replayed:
    """What a byte log says in one place.

    Attributes:
        t_s: when its last byte came, in s since the log was opened.
        raw: the bytes.
        reading: what they tell; None where they are not understood.
        why: what was wrong with them.
    """

    t_s: float
    raw: bytes
    reading: Reading | None
    why: str = ""


def replayed(protocol: Protocol, chunks: Iterable[Chunk], *, where: str) -> Iterator[Replayed]:
    """Yield readings and everything not understood, in wire order.

    Answers to commands of the start and stop sequence are left out: they are no readings, and understood. So is a
    reading whose counter makes no sense: the driver stops there, a replay goes on and says so.
    """
    answers = {step.reply for step in (*protocol.ask.start, *protocol.ask.stop) if step.reply}
    asked = protocol.ask.mode == "request"
    decoder = Decoder(protocol, joining=not asked)
    gaps = GapCounter(protocol.counter_modulus)
    last_s = 0.0
    for chunk in chunks:
        if chunk.direction == ">":
            unfinished = decoder.take_pending() if asked else b""
            if unfinished and unfinished not in answers:
                yield Replayed(last_s, unfinished, None, "no end before the next request")
            continue
        last_s = chunk.t_s
        for heard in decoder.feed(chunk.raw):
            if isinstance(heard, Garbage):
                if heard.raw not in answers:
                    yield Replayed(last_s, heard.raw, None, "joined in the middle" if heard.joining else heard.why)
                continue
            try:
                lost = gaps.lost_before(heard.reading.counter, where)
            except InstrumentError as error:
                yield Replayed(last_s, heard.raw, None, error.what)
                continue
            yield Replayed(last_s, heard.raw, replace(heard.reading, t_s=last_s, lost=lost))
    unfinished = decoder.take_pending()
    if unfinished and unfinished not in answers:
        yield Replayed(last_s, unfinished, None, "the log ends within it")
