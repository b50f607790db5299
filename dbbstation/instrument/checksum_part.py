"""The checksum part of a frame."""

from __future__ import annotations

import binascii
import zlib
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import TYPE_CHECKING, Literal, TypeAlias

from pydantic import Field

from dbbstation.files.yaml.schema import Schema
from dbbstation.instrument.fields import DIGIT, NotUnderstood, spelled

if TYPE_CHECKING:
    from collections.abc import Callable


Algorithm: TypeAlias = Literal[
    "xor8", "sum8", "negated-sum8", "sum16", "crc8", "crc16-modbus", "crc16-ccitt", "crc16-xmodem", "crc32"
]


@dataclass(frozen=True, slots=True)
class _Crc:
    """One CRC of the Rocksoft model; a reflected CRC shifts towards the low bit."""

    bits: int
    polynomial: int
    start: int
    reflected: bool

    def of(self, data: bytes) -> int:
        top, mask = 1 << (self.bits - 1), (1 << self.bits) - 1
        value = self.start
        for byte in data:
            value ^= _reversed_bits(byte, 8) << (self.bits - 8) if self.reflected else byte << (self.bits - 8)
            for _ in range(8):
                value = ((value << 1) ^ self.polynomial if value & top else value << 1) & mask
        return _reversed_bits(value, self.bits) if self.reflected else value


def _reversed_bits(value: int, bits: int) -> int:
    return int(format(value, f"0{bits}b")[::-1], 2)


_KNOWN: dict[str, tuple[int, Callable[[bytes], int]]] = {
    "xor8": (1, lambda data: reduce(xor, data, 0)),
    "sum8": (1, lambda data: sum(data) % 256),
    "negated-sum8": (1, lambda data: -sum(data) % 256),
    "sum16": (2, lambda data: sum(data) % 65536),
    "crc8": (1, _Crc(8, 0x07, 0x00, reflected=False).of),
    "crc16-modbus": (2, _Crc(16, 0x8005, 0xFFFF, reflected=True).of),
    "crc16-ccitt": (2, lambda data: binascii.crc_hqx(data, 0xFFFF)),
    "crc16-xmodem": (2, lambda data: binascii.crc_hqx(data, 0)),
    "crc32": (4, zlib.crc32),
}
"""Number of bytes, before they are written in hexadecimal, and value of each checksum. Those of the standard library are
fast enough for a stream of 90 000 bytes a second."""


def checksum(algorithm: Algorithm, data: bytes) -> int:
    """Return the checksum as an unsigned integer."""
    return _KNOWN[algorithm][1](data)


class Checksum(Schema):
    """A checksum over all bytes before it, except the first `after` bytes."""

    kind: Literal["checksum"]
    algorithm: Algorithm
    after: int = Field(default=0, ge=0)
    written: Literal["binary", "hex", "HEX"] = "binary"
    order: Literal["big", "little"] = "big"

    @property
    def width(self) -> int:
        return _KNOWN[self.algorithm][0] * (1 if self.written == "binary" else 2)

    def pattern(self) -> bytes:
        return DIGIT.get(self.written, b"[\\x00-\\xff]") + b"{%d}" % self.width

    def over(self, before: bytes) -> bytes:
        """Return the bytes of the checksum over the preceding bytes."""
        raw = checksum(self.algorithm, before[self.after :]).to_bytes(_KNOWN[self.algorithm][0], self.order)
        return spelled(raw, self.written)

    def verify(self, before: bytes, raw: bytes) -> None:
        """Check a frame's checksum.

        Raises:
            NotUnderstood: it is wrong.
        """
        should = self.over(before)
        if raw != should:
            raise NotUnderstood(f"checksum {raw.hex(' ')} instead of {should.hex(' ')}", reason="checksum")
