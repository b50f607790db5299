"""The checksum part of a frame."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dbbstation.files.yaml.schema import Schema
from dbbstation.instrument.checksums import Algorithm, checksum, checksum_bytes
from dbbstation.instrument.fields import NotUnderstood


class Checksum(Schema):
    """A checksum over everything before it, without the first `after` bytes."""

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
        """Return the checksum on the wire over all that precedes it."""
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
