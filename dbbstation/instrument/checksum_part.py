"""The checksum part of a frame."""

from __future__ import annotations

import binascii
import zlib
from dataclasses import dataclass
from functools import partial, reduce
from operator import xor
from typing import TYPE_CHECKING, Literal, TypeAlias

from pydantic import Field

from dbbstation.files.yaml.schema import Schema
from dbbstation.instrument.fields import NotUnderstood

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
    final_xor: int

    def of(self, data: bytes) -> int:
        top, mask = 1 << (self.bits - 1), (1 << self.bits) - 1
        value = self.start
        for byte in data:
            value ^= _reversed_bits(byte, 8) << (self.bits - 8) if self.reflected else byte << (self.bits - 8)
            for _ in range(8):
                value = ((value << 1) ^ self.polynomial if value & top else value << 1) & mask
        return (_reversed_bits(value, self.bits) if self.reflected else value) ^ self.final_xor


def _hqx(data: bytes, *, start: int) -> int:
    return binascii.crc_hqx(data, start)


_CRCS: dict[str, _Crc] = {
    "crc8": _Crc(8, 0x07, 0x00, reflected=False, final_xor=0),
    "crc16-modbus": _Crc(16, 0x8005, 0xFFFF, reflected=True, final_xor=0),
}

_COMPILED: dict[str, Callable[[bytes], int]] = {
    "crc16-ccitt": partial(_hqx, start=0xFFFF),
    "crc16-xmodem": partial(_hqx, start=0),
    "crc32": zlib.crc32,
}
"""Checksums of the standard library: they are fast enough for a stream of 90 000 bytes a second."""

_BYTES: dict[str, int] = {"sum16": 2, "crc16-modbus": 2, "crc16-ccitt": 2, "crc16-xmodem": 2, "crc32": 4}


def checksum_bytes(algorithm: Algorithm) -> int:
    """Return the number of checksum bytes, before they are written in hexadecimal."""
    return _BYTES.get(algorithm, 1)


def checksum(algorithm: Algorithm, data: bytes) -> int:
    """Return the checksum as an unsigned integer."""
    if algorithm == "xor8":
        return reduce(xor, data, 0)
    if algorithm in {"sum8", "sum16"}:
        return sum(data) % (1 << 8 * checksum_bytes(algorithm))
    if algorithm == "negated-sum8":
        return -sum(data) % 256
    if algorithm in _COMPILED:
        return _COMPILED[algorithm](data)
    return _CRCS[algorithm].of(data)


def _reversed_bits(value: int, bits: int) -> int:
    return int(format(value, f"0{bits}b")[::-1], 2)


class Checksum(Schema):
    """A checksum over all bytes before it, except the first `after` bytes."""

    kind: Literal["checksum"]
    algorithm: Algorithm
    after: int = Field(default=0, ge=0)
    written: Literal["binary", "hex", "HEX"] = "binary"
    order: Literal["big", "little"] = "big"

    @property
    def width(self) -> int:
        return checksum_bytes(self.algorithm) * (1 if self.written == "binary" else 2)

    def pattern(self) -> bytes:
        digit = {"binary": b"[\\x00-\\xff]", "hex": b"[0-9a-f]", "HEX": b"[0-9A-F]"}[self.written]
        return digit + b"{%d}" % self.width

    def over(self, before: bytes) -> bytes:
        """Return the bytes of the checksum over the preceding bytes."""
        raw = checksum(self.algorithm, before[self.after :]).to_bytes(checksum_bytes(self.algorithm), self.order)
        if self.written == "binary":
            return raw
        text = raw.hex().encode()
        return text.upper() if self.written == "HEX" else text

    def verify(self, before: bytes, raw: bytes) -> None:
        """Check a frame's checksum.

        Raises:
            NotUnderstood: it is wrong.
        """
        should = self.over(before)
        if raw != should:
            raise NotUnderstood(f"checksum {raw.hex(' ')} instead of {should.hex(' ')}", reason="checksum")
