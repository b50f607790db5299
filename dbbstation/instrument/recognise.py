"""Which known instrument speaks like this: for the message about one that was not expected."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.instrument.codec import Decoder
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.library import known_instruments, load_variants

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol

SMALLEST_SHARE = 0.5
"""Share of the bytes that must be readings of an instrument before it is named: more than half cannot be said of two that
understand different bytes."""


def looks_like(raw: bytes, other_than: Protocol) -> list[Protocol]:
    """Return the known instruments, with their profiles, that understand most of some bytes; the likeliest first.

    A checksum that fits says more than digits that fit, so instruments with one come first where as many bytes are understood.

    Args:
        raw: what came over the line.
    """
    found = []
    for name in known_instruments():
        for protocol in load_variants(name):
            if protocol.label == other_than.label:
                continue
            share = _understood(protocol, raw)
            if share > SMALLEST_SHARE:
                found.append((share, protocol.has_checksum, protocol))
    found.sort(key=lambda one: one[:2], reverse=True)
    return [protocol for *_, protocol in found]


def _understood(protocol: Protocol, raw: bytes) -> float:
    """Share of the bytes that are readings with a length; messages alone are too short to say much."""
    heard = (
        Decoder(protocol, joining=True).feed(raw) if protocol.by_width else Decoder(protocol, joining=False).feed(raw)
    )
    readings = [one for one in heard if isinstance(one, Piece) and one.reading.length_mm is not None]
    return sum(len(one.raw) for one in readings) / max(len(raw), 1)
