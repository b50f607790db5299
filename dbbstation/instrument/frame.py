"""One kind of frame: its parts in order, which read and write it."""

from __future__ import annotations

import re
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from dbbstation.files.yaml.schema import Rules, Schema
from dbbstation.instrument.checksum_part import Checksum
from dbbstation.instrument.fields import (
    ChoiceField,
    ErrorTable,
    Flags,
    FrameParts,
    Literally,
    SignField,
    SkipField,
    Text,
)
from dbbstation.instrument.numbers import DecimalText, Ieee, Integer
from dbbstation.instrument.reading import SaidStatus  # noqa: TC001 (pydantic needs it at run time)

if TYPE_CHECKING:
    from dbbstation.instrument.fields import Bit, Code, Content

Number: TypeAlias = DecimalText | Integer | Ieee

_Plain: TypeAlias = Literally | SignField | Number | ChoiceField | Flags | SkipField | Text | ErrorTable

PlainPart: TypeAlias = Annotated[_Plain, Field(discriminator="kind")]


class Optionally(Schema):
    """Parts of a feature that may be switched off; frames with and without them are read.

    Attributes:
        feature: written if in the protocol's `features`.
    """

    kind: Literal["optional"]
    feature: str = Field(min_length=1)
    parts: tuple[PlainPart, ...] = Field(min_length=1)

    width: ClassVar[None] = None

    def pattern(self) -> bytes:
        """Return the pattern of all parts or nothing."""
        return b"(?:" + b"".join(part.pattern() for part in self.parts) + b")?"

    def read(self, raw: bytes, found: FrameParts) -> None:
        """Read the parts if present.

        Raises:
            NotUnderstood: a part is meaningless.
        """
        match = self._pattern.fullmatch(raw) if raw else None
        if match is None:
            return
        for group, part in enumerate(self.parts, start=1):
            part.read(match[group], found)

    def write(self, content: Content) -> bytes:
        """Return the parts if the feature is on.

        Raises:
            NotRepresentable: a number does not fit.
        """
        if self.feature not in content.features:
            return b""
        return b"".join(part.write(content) for part in self.parts)

    @cached_property
    def _pattern(self) -> re.Pattern[bytes]:
        return _grouped(self.parts)


def _grouped(parts: tuple[Part, ...]) -> re.Pattern[bytes]:
    return re.compile(b"".join(b"(" + part.pattern() + b")" for part in parts))


Part: TypeAlias = Annotated[_Plain | Checksum | Optionally, Field(discriminator="kind")]


class Frame(Schema):
    """One kind of frame; without a length it is a message.

    Attributes:
        bare: no prefix, no end, no line end, as for single control characters.
        means: meaning of the message, to which its text or code is added.
    """

    name: str = "reading"
    status: SaidStatus = "ok"
    means: str = ""
    remedy: str = ""
    bare: bool = False
    parts: tuple[Part, ...] = Field(min_length=1)

    @property
    def is_message(self) -> bool:
        """Return whether it has no length."""
        return self.number is None

    @property
    def number(self) -> Number | None:
        """Return the part with the length."""
        return self._number_of("length")

    @property
    def counter(self) -> Number | None:
        """Return the part with the sample counter."""
        return self._number_of("counter")

    def _number_of(self, what: str) -> Number | None:
        return next((part for part in self.parts if isinstance(part, Number) and part.of == what), None)

    def _rules(self) -> Rules:
        kinds = [part.of for part in self.parts if isinstance(part, Number)]
        yield len(set(kinds)) < len(kinds), "a frame has at most one length and one counter"
        silent = self.is_message and (self.status == "ok" or not self.means)
        yield silent, "a frame without a length is a message: give it a status that is not ok, and means"
        varies = self.bare and any(not isinstance(part, Literally) for part in self.parts)
        yield varies, "a bare frame has fixed bytes only: its end is unknown otherwise"

    @property
    def width(self) -> int | None:
        """Return the number of bytes of the frame; None if it varies."""
        widths = [part.width for part in self.parts]
        return None if None in widths else sum(width for width in widths if width is not None)

    def literal(self, place: int) -> bytes:
        """Return the bytes of a part of the frame, counted from 0 or from -1 at its end; empty if they vary."""
        part = self.parts[place]
        return part.value if isinstance(part, Literally) else b""

    @property
    def binary(self) -> bool:
        """Return whether bytes inside may look like a line end."""
        return any(
            isinstance(part, Flags)
            or (isinstance(part, Number) and part.binary)
            or (isinstance(part, Checksum) and part.written == "binary")
            for part in self.parts
        )

    @cached_property
    def pattern(self) -> re.Pattern[bytes]:
        """Return the frame as a pattern with one group per part."""
        return _grouped(self.parts)

    @property
    def voices(self) -> tuple[Code | Bit, ...]:
        """Return every code and bit that stands for a status."""
        found: list[Code | Bit] = []
        for part in self.parts:
            if isinstance(part, ChoiceField | ErrorTable):
                found += part.codes
            elif isinstance(part, Flags):
                found += part.bits
            elif isinstance(part, Number):
                found += part.specials
        return tuple(voice for voice in found if voice.status != "ok")

    def read(self, match: re.Match[bytes]) -> FrameParts:
        """Return the content of a match of `pattern`.

        Raises:
            NotUnderstood: a number or checksum is wrong.
        """
        found = FrameParts()
        found.report(self.status, self.means, self.remedy)
        for group, part in enumerate(self.parts, start=1):
            if isinstance(part, Checksum):
                part.verify(match.string[match.start() : match.start(group)], match[group])
            else:
                part.read(match[group], found)
        if found.text:
            found.said = f"{found.said}: {found.text}" if found.said else found.text
        return found

    def write(self, content: Content) -> bytes:
        """Return the frame as bytes.

        Raises:
            NotRepresentable: a number does not fit.
        """
        number = self.number
        value = (number.as_read(content.value) if number else 0.0) + 0.0
        signed = content.of(value)
        unsigned = content.of(abs(value))
        has_sign = any(isinstance(part, SignField) for part in self.parts)
        raw = b""
        for part in self.parts:
            if isinstance(part, Checksum):
                raw += part.over(raw)
            else:
                raw += part.write(signed if isinstance(part, SignField) or not has_sign else unsigned)
        return raw
