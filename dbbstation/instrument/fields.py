"""The parts of a frame on the wire, with a device's messages and error numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import BeforeValidator, Field, PlainSerializer

from dbbstation.files.yaml.schema import Rules, Schema
from dbbstation.instrument.reading import SEVERITY, SaidStatus, Status

Unit: TypeAlias = Literal["mm", "um", "nm", "m", "inch", "count"]


Reason: TypeAlias = Literal["bytes", "parity", "checksum", "counter"]
"""Reason for rejecting a frame: its bytes do not fit the grammar, a character has a wrong parity, the checksum is
wrong, or the sample counter is out of order."""


class NotUnderstood(ValueError):  # noqa: N818 (it is no error of the program: most garbled bytes end here)
    """Bytes that contradict the grammar."""

    def __init__(self, what: str, reason: Reason = "bytes") -> None:
        self.reason: Reason = reason
        super().__init__(what)


class NotRepresentable(ValueError):  # noqa: N818 (the device meets this too, and reports overrange)
    """A value that does not fit the field."""


def _as_bytes(value: object) -> object:
    if not isinstance(value, str):
        return value
    if escape := re.search(r"\\(?:[rntx0]|u)", value):
        raise ValueError(f'`{escape[0]}` is two characters here: escapes need double quotes, such as "M1\\r"')
    try:
        return value.encode("latin-1")
    except UnicodeEncodeError:
        raise ValueError("characters on a wire are bytes: nothing above \\xff") from None


Bytes: TypeAlias = Annotated[
    bytes, BeforeValidator(_as_bytes), PlainSerializer(lambda raw: raw.decode("latin-1"), return_type=str)
]
"""Bytes, written in the file as a quoted string with escapes: `"\\x02"`, `"\\r\\n"`, `"M1"`."""


@dataclass(slots=True)
class FrameParts:
    """Parsed parts of one frame so far.

    Attributes:
        value: in device units, without a `sign` part.
        sign: 1 or -1.
        unit: None: the protocol's.
        status, said, remedy: the worst status that a part reported.
        digits: before and behind the point of the length; None if not decimal.
    """

    value: float | None = None
    sign: int = 1
    unit: Unit | None = None
    counter: int | None = None
    status: Status = "ok"
    said: str = ""
    remedy: str = ""
    text: str = ""
    digits: tuple[int, int] | None = None

    def report(self, status: Status, said: str, remedy: str) -> None:
        """Keep a status if it is the worst so far."""
        if SEVERITY[status] > SEVERITY[self.status]:
            self.status, self.said, self.remedy = status, said, remedy


@dataclass(frozen=True, slots=True)
class Content:
    """The content of a frame.

    Attributes:
        value: signed, in device units.
        voice: code or bit of a status.
        features: names of switched-on features, for optional parts.
    """

    value: float
    counter: int = 0
    voice: Code | Bit | None = None
    features: tuple[str, ...] = ()

    def of(self, value: float) -> Content:
        """Return the content with another value."""
        return replace(self, value=value)


class Code(Schema):
    """A code, its meaning, and the `remedy` of a bad status."""

    code: Bytes
    means: str
    status: SaidStatus = "ok"
    unit: Unit | None = None
    remedy: str = ""


class Bit(Schema):
    """One status bit, from the lowest, 0."""

    bit: int = Field(ge=0, le=7)
    means: str
    status: SaidStatus
    remedy: str = ""


class Literally(Schema):
    """Fixed bytes."""

    kind: Literal["literal"]
    value: Bytes = Field(min_length=1)

    @property
    def width(self) -> int:
        return len(self.value)

    def pattern(self) -> bytes:
        return re.escape(self.value)

    def read(self, raw: bytes, found: FrameParts) -> None:
        """Do nothing: the pattern matched."""

    def write(self, content: Content) -> bytes:  # noqa: ARG002 (every part has this signature)
        return self.value


class SignField(Schema):
    """The sign as a separate part; the first character of `plus` or `minus` is written."""

    kind: Literal["sign"]
    plus: tuple[Bytes, ...] = (b"+",)
    minus: tuple[Bytes, ...] = (b"-",)

    def _rules(self) -> Rules:
        wrong = not self.plus or not self.minus or any(len(code) != 1 for code in self.plus + self.minus)
        yield wrong, "plus and minus list single characters, at least one each"

    width: ClassVar[int] = 1

    def pattern(self) -> bytes:
        return b"[" + re.escape(b"".join(self.plus + self.minus)) + b"]"

    def read(self, raw: bytes, found: FrameParts) -> None:
        found.sign = -1 if raw in self.minus else 1

    def write(self, content: Content) -> bytes:
        return self.minus[0] if content.value < 0 else self.plus[0]


class _Codes(Schema):
    """Codes, each with its meaning; the first is written if none stands for the status."""

    codes: tuple[Code, ...] = Field(min_length=1)

    def _rules(self) -> Rules:
        yield len({code.code for code in self.codes}) < len(self.codes), "two codes are the same bytes"

    @property
    def width(self) -> int | None:
        widths = {len(code.code) for code in self.codes}
        return widths.pop() if len(widths) == 1 else None

    def write(self, content: Content) -> bytes:
        return next((code.code for code in self.codes if code is content.voice), self.codes[0].code)


class ChoiceField(_Codes):
    """One of several codes; the first is written if there is no bad status."""

    kind: Literal["choice"]

    def _rules(self) -> Rules:
        yield from super()._rules()
        what = "the first code is what the device writes when all is well: its status must be ok"
        yield self.codes[0].status != "ok", what

    def pattern(self) -> bytes:
        longest_first = sorted((one.code for one in self.codes), key=len, reverse=True)
        return b"(?:" + b"|".join(map(re.escape, longest_first)) + b")"

    def read(self, raw: bytes, found: FrameParts) -> None:
        code = next(code for code in self.codes if code.code == raw)
        found.unit = code.unit or found.unit
        found.report(code.status, code.means, code.remedy)


class Flags(Schema):
    """Status bits of one byte, added to a fixed base."""

    kind: Literal["flags"]
    base: int = Field(default=0, ge=0, le=255)
    bits: tuple[Bit, ...] = Field(min_length=1)

    width: ClassVar[int] = 1

    def pattern(self) -> bytes:
        free = sum(1 << bit.bit for bit in self.bits)
        allowed = sorted({value for value in range(256) if value & ~free == self.base & ~free})
        return b"[" + b"".join(re.escape(bytes([value])) for value in allowed) + b"]"

    def read(self, raw: bytes, found: FrameParts) -> None:
        for bit in self.bits:
            if (raw[0] ^ self.base) >> bit.bit & 1:
                found.report(bit.status, bit.means, bit.remedy)

    def write(self, content: Content) -> bytes:
        return bytes([self.base ^ sum(1 << bit.bit for bit in self.bits if bit is content.voice)])


class SkipField(Schema):
    """A fixed number of ignored bytes; the virtual instrument writes `written`."""

    kind: Literal["skip"]
    written: Bytes = Field(min_length=1)

    @property
    def width(self) -> int:
        return len(self.written)

    def pattern(self) -> bytes:
        return b"[\\x00-\\xff]{%d}" % self.width

    def read(self, raw: bytes, found: FrameParts) -> None:
        """Ignore them."""

    def write(self, content: Content) -> bytes:  # noqa: ARG002 (every part has this signature)
        return self.written


DIGIT = {"hex": b"[0-9a-f]", "HEX": b"[0-9A-F]"}
"""Pattern of a digit of hexadecimal text."""


def spelled(raw: bytes, written: str) -> bytes:
    """Return bytes as they are, or as hexadecimal text in small letters or capitals."""
    return {"hex": raw.hex(), "HEX": raw.hex().upper()}[written].encode() if written in DIGIT else raw


_PRINTABLE = b"[\\x20-\\x7e]"


class Text(Schema):
    """The device's message, which is appended to the frame's meaning.

    Attributes:
        width: characters; None: 1 to `max_width`.
    """

    kind: Literal["text"]
    width: int | None = Field(default=None, ge=1, le=80)
    max_width: int = Field(default=40, ge=1, le=80)
    written: str = Field(min_length=1)

    def _rules(self) -> Rules:
        wide = len(self.written) > (self.width or self.max_width)
        yield wide or not self.written.isascii(), "`written` must be ASCII and fit into the width"

    def pattern(self) -> bytes:
        return _PRINTABLE + (b"{%d}" % self.width if self.width else b"{1,%d}" % self.max_width)

    def read(self, raw: bytes, found: FrameParts) -> None:
        found.text = raw.decode("ascii").strip()

    def write(self, content: Content) -> bytes:  # noqa: ARG002 (every part has this signature)
        return self.written.ljust(self.width or 0).encode("ascii")


class ErrorTable(_Codes):
    """Error numbers with meanings; unknown ones are reported as they are.

    Attributes:
        codes: the first stands for any other fault in the virtual instrument.
    """

    kind: Literal["errors"]

    def _rules(self) -> Rules:
        yield from super()._rules()
        yield self.width is None, "the codes of errors are of one width"
        yield any(code.status == "ok" for code in self.codes), "an error has a status that is not ok"

    def pattern(self) -> bytes:
        known = b"|".join(re.escape(code.code) for code in self.codes)
        return b"(?:" + known + b"|" + _PRINTABLE + b"{%d})" % len(self.codes[0].code)

    def read(self, raw: bytes, found: FrameParts) -> None:
        code = next((one for one in self.codes if one.code == raw), None)
        if code is None:
            found.text = f"code {raw.decode('ascii')}, which its protocol file does not list"
            return
        found.status, found.said, found.remedy = code.status, code.means, code.remedy or found.remedy
