"""Bytes received at another baud rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import LineSettings

TOLERANCE = 0.04
"""A UART samples the last bit of ten in its middle: half a bit in ten, less some sampling error, is what it bears."""


def heard_at(raw: bytes, line: LineSettings, *, sent_baud: int, heard_baud: int) -> bytes:
    """Return what a receiver at `heard_baud` makes of `raw` sent at `sent_baud`."""
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
