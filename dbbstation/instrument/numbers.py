"""Numeric parts of a frame: text, integers, IEEE floats."""

from __future__ import annotations

import math
import re
import struct
from functools import cached_property
from typing import ClassVar, Literal

from pydantic import Field

from dbbstation.files.yaml.schema import Rules, Schema
from dbbstation.instrument.fields import DIGIT, Code, Content, FrameParts, NotRepresentable, NotUnderstood, spelled


class Number(Schema):
    """Common parts of numbers.

    Attributes:
        modulus: of a counter.
        scale: length of the number 1 on the wire, in the length's unit; 0.0001 for four implicit decimals.
    """

    of: Literal["length", "counter"] = "length"
    modulus: int | None = Field(default=None, ge=2)
    scale: float = Field(default=1.0, gt=0.0)
    specials: tuple[Code, ...] = ()

    def _rules(self) -> Rules:
        yield (self.of == "counter") != (self.modulus is not None), "a modulus is for counters only"
        width = getattr(self, "width", None)
        narrow = width and any(len(special.code) != width for special in self.specials)
        yield narrow, "write each special code with as many characters as its field has"

    def pattern(self) -> bytes:
        specials = b"".join(re.escape(special.code) + b"|" for special in self.specials)
        return b"(?:" + specials + self._digits() + b")"

    def read(self, raw: bytes, found: FrameParts) -> None:
        for special in self.specials:
            if special.code == raw:
                found.report(special.status, special.means, special.remedy)
                return
        value = self._parsed(raw)
        if self.of == "length":
            found.value = self._times(value, self.scale)
            found.digits = self._places(raw)
        else:
            found.counter = int(value)

    def write(self, content: Content) -> bytes:
        """Return the bytes of the number, or of the special code for the status.

        Raises:
            NotRepresentable: it does not fit.
        """
        for special in self.specials:
            if special is content.voice:
                return special.code
        if self.of == "counter":
            return self._written(content.counter % (self.modulus or 1))
        return self._written(self._times(content.value, 1.0 / self.scale))

    def as_read(self, value: float) -> float:
        """Return a length as it reads after it was written, in its unit."""
        return self._times(self.rounded(self._times(value, 1.0 / self.scale)), self.scale)

    @staticmethod
    def _times(value: float, factor: float) -> float:
        # Twelve digits: 1500003 times 0.0001 is 150.0003, not 150.00030000000001; no gauge has more.
        return value if factor == 1.0 else float(f"{value * factor:.12g}")

    def rounded(self, value: float) -> float:
        return value

    def _digits(self) -> bytes:
        raise NotImplementedError

    def _places(self, raw: bytes) -> tuple[int, int] | None:  # noqa: ARG002 (numbers in text have digits)
        return None

    def _parsed(self, raw: bytes) -> float:
        raise NotImplementedError

    def _written(self, value: float) -> bytes:
        raise NotImplementedError


class DecimalText(Number):
    """A decimal number in text.

    Attributes:
        width: with sign and point; None: free, at most `max_width`.
        decimals: number written; other numbers are read only with `decimals_vary`.
        pad: filling on the left.
        signed: the field has a sign, `plus` for positive numbers. A non-blank sign is required; a blank may be filling.
        min_width: of a free width, filled with blanks or zeros; narrower is invalid.
        leading_zero: 0 before the point of numbers below one.
    """

    kind: Literal["decimal"]
    width: int | None = Field(default=None, ge=1)
    max_width: int = Field(default=16, ge=1)
    decimals: int = Field(default=0, ge=0, le=9)
    decimals_vary: bool = False
    point: Literal[".", ","] = "."
    pad: Literal[" ", "0"] = " "
    signed: bool = False
    plus: Literal["", "+", " "] = ""
    min_width: int = Field(default=0, ge=0)
    leading_zero: bool = True

    binary: ClassVar[bool] = False

    def rounded(self, value: float) -> float:
        return round(value, self.decimals) + 0.0

    def _digits(self) -> bytes:
        characters = b"[ 0-9+-" + re.escape(self.point.encode()) + b"]"
        if self.width:
            return characters + b"{%d}" % self.width
        return characters + b"{%d,%d}" % (max(self.min_width, 1), max(self.min_width, self.max_width))

    def _places(self, raw: bytes) -> tuple[int, int]:
        before, _, behind = raw.decode("latin-1").partition(self.point)
        return sum(one.isdigit() for one in before), len(behind)

    @cached_property
    def _grammar(self) -> re.Pattern[str]:
        blanks = " *" if self.pad == " " or self.plus == " " else ""
        sign = ""
        if self.signed:
            sign = "[+-]?" if not self.plus else "[+ -]" if blanks else "[+-]"
        return re.compile(rf"{blanks}({sign}){blanks}(\d*)(?:{re.escape(self.point)}(\d*))?")

    def _parsed(self, raw: bytes) -> float:
        match = self._grammar.fullmatch(raw.decode("latin-1"))
        if match is None or not (match[2] or match[3]):
            raise NotUnderstood(f"{raw!r} is no number")
        if not self.decimals_vary and len(match[3] or "") != self.decimals:
            raise NotUnderstood(f"{raw!r} has not {self.decimals} decimals")
        return float(f"{match[1].strip()}{match[2] or '0'}.{match[3] or '0'}")

    def _written(self, value: float) -> bytes:
        if value < 0 and not self.signed:
            raise NotRepresentable("the wire has no sign for a negative number")
        body = f"{abs(value):.{self.decimals}f}".replace(".", self.point)
        if not self.leading_zero and self.decimals:
            body = body.removeprefix("0")
        sign = ("-" if value < 0 else self.plus) if self.signed else ""
        width = self.width or self.min_width
        text = sign + body.rjust(width - len(sign), "0") if self.pad == "0" else (sign + body).rjust(width)
        if len(text) > (self.width or self.max_width):
            raise NotRepresentable(f"{text} is wider than {self.width or self.max_width} characters")
        return text.encode("latin-1")


class Integer(Number):
    """A whole number.

    Attributes:
        size: bytes of the number, half the characters in hexadecimal.
        signed: two's complement.
        written: `binary`, `bcd` (two digits a byte), `hex` or `HEX` (text).
        tags: upper bits of each byte in wire order that mark the start; the other `payload_bits` are the number.
    """

    kind: Literal["integer"]
    size: int = Field(ge=1, le=8)
    order: Literal["big", "little"] = "big"
    signed: bool = False
    written: Literal["binary", "bcd", "hex", "HEX"] = "binary"
    tags: tuple[int, ...] = ()
    payload_bits: int = Field(default=8, ge=1, le=8)

    def _rules(self) -> Rules:
        tagged, low = bool(self.tags), (1 << self.payload_bits) - 1
        yield tagged != (self.payload_bits < 8), "give tags together with payload_bits below 8"  # noqa: PLR2004 (bits of a byte)
        per_byte = len(self.tags) == self.size and self.written == "binary"
        yield tagged and not per_byte, "one tag per byte, and only for binary numbers"
        beyond = any(tag & low or not 0 <= tag <= 255 for tag in self.tags)  # noqa: PLR2004
        yield beyond, "a tag uses only the bits above payload_bits"
        yield self.signed and self.written == "bcd", "packed BCD has no sign of its own: use a sign part"
        yield from super()._rules()

    @property
    def width(self) -> int:
        return self.size * (2 if self.written in {"hex", "HEX"} else 1)

    @property
    def binary(self) -> bool:
        return self.written in {"binary", "bcd"}

    def rounded(self, value: float) -> float:
        return float(round(value))

    def _digits(self) -> bytes:
        if self.tags:
            top = (1 << self.payload_bits) - 1
            return b"".join(b"[\\x%02x-\\x%02x]" % (tag, tag | top) for tag in self.tags)
        return DIGIT.get(self.written, b"[\\x00-\\xff]") + b"{%d}" % self.width

    def _parsed(self, raw: bytes) -> float:
        if self.written == "bcd":
            text = (raw if self.order == "big" else raw[::-1]).hex()
            if not text.isdecimal():
                raise NotUnderstood(f"{raw.hex(' ')} is no packed decimal number")
            return int(text)
        if self.written != "binary":
            raw = bytes.fromhex(raw.decode("ascii"))
        mask, bits = (1 << self.payload_bits) - 1, self.payload_bits * self.size
        value = 0
        for byte in raw if self.order == "big" else raw[::-1]:
            value = value << self.payload_bits | byte & mask
        return value - (1 << bits) if self.signed and value >> (bits - 1) else value

    def _written(self, value: float) -> bytes:
        number = round(value)
        if self.written == "bcd":
            digits = str(abs(number)).rjust(2 * self.size, "0")
            if len(digits) > 2 * self.size:
                raise NotRepresentable(f"{number} has more than {2 * self.size} digits")
            raw = bytes.fromhex(digits)
            return raw if self.order == "big" else raw[::-1]
        bits = self.payload_bits * self.size
        low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if self.signed else (0, (1 << bits) - 1)
        if not low <= number <= high:
            raise NotRepresentable(f"{number} is outside {low} to {high}")
        number %= 1 << bits
        mask = (1 << self.payload_bits) - 1
        pieces = [number >> self.payload_bits * place & mask for place in reversed(range(self.size))]
        if self.order == "little":
            pieces.reverse()
        raw = bytes(piece | tag for piece, tag in zip(pieces, self.tags or (0,) * self.size, strict=True))
        return spelled(raw, self.written)


class Ieee(Number):
    """An IEEE 754 number of 4 or 8 bytes. Not-a-number is rejected unless it is a special code."""

    kind: Literal["float"]
    size: Literal[4, 8] = 4
    order: Literal["big", "little"] = "big"

    @property
    def width(self) -> int:
        return self.size

    binary: ClassVar[bool] = True

    @property
    def _format(self) -> str:
        return (">" if self.order == "big" else "<") + ("f" if self.size == 4 else "d")  # noqa: PLR2004 (bytes)

    def rounded(self, value: float) -> float:
        return float(struct.unpack(self._format, struct.pack(self._format, value))[0])

    def _digits(self) -> bytes:
        return b"[\\x00-\\xff]{%d}" % self.size

    def _parsed(self, raw: bytes) -> float:
        value = float(struct.unpack(self._format, raw)[0])
        if not math.isfinite(value):
            raise NotUnderstood(f"{raw.hex(' ')} is not a finite number")
        return value

    def _written(self, value: float) -> bytes:
        try:
            return struct.pack(self._format, value)
        except OverflowError as error:
            raise NotRepresentable(str(error)) from None
