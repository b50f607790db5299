"""Mark and count characters with wrong parity or stop bit, which never become part of a reading.

A serial driver checks parity only with INPCK and marks wrong characters only with PARMRK: FF 00 X for a wrong X, FF FF
for a right FF, FF 00 00 for a break [IEEE Std 1003.1-2017, 11.2.2 Input Modes]. pyserial 3.5 resets both
(`serialposix.py`, `_reconfigure_port`), so they are set after it. Windows, sockets and RFC 2217 servers mark nothing.

A wrong character gets its eighth bit set on a seven-bit line and becomes NUL on an eight-bit line. No instrument's text
contains either, so the frame is rejected, and byte logs keep the received bytes.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import LineSettings

_ESCAPED = re.compile(rb"\xff(?:\xff|\x00([\x00-\xff])|(\x00?\Z))")

_SEVEN, _EIGHTH_BIT = 7, 0x80


class Marks:
    """Removes the system's marks from received bytes, cut anywhere."""

    def __init__(self, data_bits: int) -> None:
        self._seven = data_bits == _SEVEN
        self._begun = b""

    def taken_out(self, raw: bytes) -> bytes:
        """Return the bytes without the system's marks; damaged characters are changed."""
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
    """Return the number of characters with wrong parity, from bytes after `Marks`."""
    if line.parity == "none":
        return 0
    return sum(byte >= _EIGHTH_BIT for byte in raw) if line.data_bits == _SEVEN else raw.count(0)
