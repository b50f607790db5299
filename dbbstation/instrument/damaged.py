"""Characters that came with a wrong parity or stop bit: marked by the system, counted, never part of a reading.

A serial driver compares the parity bit of each character only where it is told to (INPCK), and the system says which characters
were wrong only where it is told to (PARMRK): the three bytes FF 00 X stand for a wrong X then, FF FF for a right FF, FF 00 00
for a break [IEEE Std 1003.1-2017, 11.2.2 Input Modes]. pyserial 3.5 switches both off whenever it sets up a port
(`serialposix.py`, `_reconfigure_port`), so they are switched on behind it. Windows, sockets and RFC 2217 servers mark nothing.

In the bytes that go on from here a wrong character has its eighth bit set where a line has seven data bits, and is a NUL where it
has eight: no text of an instrument has either, so no frame with such a character is believed, and a byte log keeps what came.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import LineSettings

_ESCAPED = re.compile(rb"\xff(?:\xff|\x00([\x00-\xff])|(\x00?\Z))")

_SEVEN, _EIGHTH_BIT = 7, 0x80


class Marks:
    """Takes the system's marks out of what a line brings; they may be cut anywhere between two reads.

    Args:
        data_bits: 7 or 8, as the port is opened.
    """

    def __init__(self, data_bits: int) -> None:
        self._seven = data_bits == _SEVEN
        self._begun = b""

    def taken_out(self, raw: bytes) -> bytes:
        """Return the bytes as the rest of the program takes them."""
        raw, self._begun = self._begun + raw, b""
        return _ESCAPED.sub(self._plain, raw)

    def _plain(self, found: re.Match[bytes]) -> bytes:
        if found[2] is not None:
            self._begun = found[0]
            return b""
        if found[1] is None:
            return b"\xff"
        return bytes([found[1][0] | _EIGHTH_BIT]) if self._seven else b"\x00"


def damaged_in(raw: bytes, line: LineSettings) -> int:
    """Return how many characters of a text came with a wrong parity, by the bytes that `Marks` gives."""
    if line.parity == "none":
        return 0
    return sum(byte >= _EIGHTH_BIT for byte in raw) if line.data_bits == _SEVEN else raw.count(0)
