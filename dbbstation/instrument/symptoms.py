"""Find likely causes of symptoms on the line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InstrumentError
from dbbstation.instrument.codec import Decoder
from dbbstation.instrument.damaged import damaged_in
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.fields import Content
from dbbstation.instrument.library import known_instruments, load_variants

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol


SMALLEST_SHARE = 0.5
"""Least share of the bytes that an instrument must decode before it is named. Two instruments that decode different
bytes cannot both exceed one half."""


def looks_like(raw: bytes, other_than: Protocol) -> list[Protocol]:
    """Return the known instruments and profiles that decode these bytes best, the likeliest first."""
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
    heard = Decoder(protocol, joining=protocol.by_width).feed(raw)
    readings = [one for one in heard if isinstance(one, Piece) and one.reading.length_mm is not None]
    return sum(len(one.raw) for one in readings) / max(len(raw), 1)


_TELLING_BYTES = 12

_MOSTLY = 0.25
"""Share of characters with wrong parity above which noise is excluded. If the device uses the other parity, all
characters are wrong; without parity, half of them."""

_OTHERS = 3
"""Greatest number of likely instruments in a message."""

_SHOWN = 24
"""Number of bytes in a message, enough for a whole line of each known instrument."""


def silence(protocol: Protocol, where: str, waited_s: float, baud: int, *, heard_before: bool) -> InstrumentError:
    """Return the error for a silent line."""
    if heard_before:
        what = f"the instrument fell silent: nothing for {waited_s:g} s"
        remedy = "is it still switched on, is the cable still plugged in at both ends?"
    else:
        asked = f" to the request {protocol.ask.request.hex(' ')}" if protocol.ask.request else ""
        what = f"the instrument is silent: no answer{asked} in {waited_s:g} s"
        others = ", ".join(str(rate) for rate in protocol.line.baud_choices if rate != baud)
        remedy = (
            f"is it switched on, is the cable a null-modem one and plugged into this port, is it set to {baud} baud"
            + (f" (it can also be set to {others})" if others else "")
            + f", with {protocol.line.bits_text}?"
        )
    return InstrumentError(what, where=where, remedy=remedy)


def half_line(raw: bytes, where: str, waited_s: float) -> InstrumentError:
    """Return the error for an unfinished frame."""
    return InstrumentError(
        f"only part of a reply came, then nothing for {waited_s:g} s: {shown(raw)}",
        where=where,
        remedy="check the cable; if it happens often, lower the baud rate on both sides",
    )


def garbage(
    protocol: Protocol, where: str, raw: bytes, why: str, baud: int, *, marked: bool = False
) -> InstrumentError:
    """Return the error for unreadable bytes, with the likeliest cause."""
    return InstrumentError(
        f"what comes is not {protocol.label}: {shown(raw)}" + (f" ({why})" if why else ""),
        where=where,
        remedy=_cause(protocol, raw, baud, marked=marked),
    )


def begins_well(protocol: Protocol, raw: bytes) -> bool:
    """Return whether a frame could begin with these bytes."""
    for frame in protocol.frames:
        example = frame.write(Content(0.0, features=protocol.features))
        if any(frame.pattern.fullmatch(raw + example[cut:]) for cut in range(1, len(example))):
            return True
    return False


def shown(raw: bytes) -> str:
    """Return bytes in hexadecimal, and also as text if most are text."""
    head = raw[:_SHOWN]
    text = head.hex(" ") + (f" … ({len(raw)} bytes)" if len(raw) > _SHOWN else "")
    printable = sum(32 <= byte < 127 for byte in head)  # noqa: PLR2004 (printable ASCII)
    return f"{text} = {head.decode('latin-1')!r}" if 2 * printable > len(head) else text


def _cause(protocol: Protocol, raw: bytes, baud: int, *, marked: bool) -> str:
    seven_bits = bytes(byte & 0x7F for byte in raw)
    if seven_bits != raw and any(isinstance(one, Piece) for one in Decoder(protocol, joining=False).feed(seven_bits)):
        damaged = damaged_in(raw, protocol.line)
        if damaged and (marked or not parity_in(raw)):
            # A device without parity sends a zero in its place: what has an odd number of bits then is wrong.
            few = damaged < _MOSTLY * len(raw)
            cause = "look after the cable and its screen" if few else f"set the device to {protocol.line.text}"
            return f"{damaged} of its {len(raw)} characters came with a wrong parity: {cause}"
        # Seven bits and a parity in eight: the port is set to eight, or the device to seven.
        wrong = "the device" if protocol.line.data_bits == 8 else "the port"  # noqa: PLR2004 (bits)
        return (
            f"without the highest bit it is a reading, and that bit is {parity_in(raw) or 'something else'}: "
            f"set data bits and parity of {wrong} to {protocol.line.text}"
        )
    others = looks_like(raw, protocol)
    if not others and seven_bits != raw and parity_in(raw):
        others = looks_like(seven_bits, protocol)
    if others:
        like = " or ".join(_as_options(one) for one in others[:_OTHERS])
        return f"it looks like another instrument: {like}; name that one, with its settings of the line"
    strange = sum(byte >= 0x80 or (byte < 0x20 and byte not in b"\r\n\x02") for byte in raw)  # noqa: PLR2004 (ASCII)
    binary = any(frame.binary for frame in protocol.frames)
    if strange and not binary:
        rates = ", ".join(str(rate) for rate in protocol.line.baud_choices) or str(protocol.line.baud)
        return (
            f"most likely the baud rate: the port uses {baud}, the instrument can be set to {rates}; or a noisy cable"
        )
    return f"is it this instrument, set as `dbbstation instrument list {protocol.name}` says, with nothing else on the line?"


def parity_in(raw: bytes) -> str:
    """Return the parity that the highest bits show; empty if none.

    Twelve equal parities occur by chance once in 4096 times; fewer are ignored.
    """
    even = sum(byte.bit_count() % 2 == 0 for byte in raw)
    if len(raw) < _TELLING_BYTES or 0 < even < len(raw):
        return ""
    return "even parity" if even else "odd parity"


def _as_options(protocol: Protocol) -> str:
    return f"--instrument {protocol.name}" + (f" --profile {protocol.profile}" if protocol.profile else "")
