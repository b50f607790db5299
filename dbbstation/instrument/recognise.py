"""Recognise an unexpected instrument for a message."""

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
    """Return known instruments and profiles that decode some bytes best, the likeliest first."""
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
    heard = (
        Decoder(protocol, joining=True).feed(raw) if protocol.by_width else Decoder(protocol, joining=False).feed(raw)
    )
    readings = [one for one in heard if isinstance(one, Piece) and one.reading.length_mm is not None]
    return sum(len(one.raw) for one in readings) / max(len(raw), 1)
