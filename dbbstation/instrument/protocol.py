"""The wire protocol of a length instrument, `dbb-instrument/2`: what one YAML file in `protocols/instruments` says.

Protocol
├── line       baud rate, bits, parity, stop bits, flow control
├── ask        how a reading is obtained: asked for each time, or streaming; commands to start and to stop
├── length     unit, sense, range
├── frames     what comes over the wire: one frame that carries the length, others that are messages
└── timing     latency, rate, patience
"""

from __future__ import annotations

import re
from functools import cached_property
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from dbbstation.files.yaml.schema import Schema
from dbbstation.instrument.fields import (
    Bit,
    Bytes,
    Checksum,
    Choice,
    Code,
    Content,
    Flags,
    Found,
    Literally,
    NotRepresentable,
    NotUnderstood,
    Sign,
    Skip,
    Unit,
)
from dbbstation.instrument.numbers import DecimalText, Ieee, Integer
from dbbstation.instrument.reading import SEVERITY, Status

Part: TypeAlias = Annotated[
    Literally | Sign | DecimalText | Integer | Ieee | Choice | Flags | Checksum | Skip, Field(discriminator="kind")
]

_MM_PER_UNIT: dict[Unit, float] = {"mm": 1.0, "um": 1e-3, "nm": 1e-6, "m": 1e3, "inch": 25.4}


class Line(Schema):
    """Settings of the serial line; `baud_choices` are the rates that the device can be set to."""

    baud: int = Field(gt=0)
    baud_choices: tuple[int, ...] = ()
    data_bits: Literal[7, 8] = 8
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1
    flow: Literal["none", "rts-cts", "xon-xoff"] = "none"

    @property
    def bits_per_character(self) -> int:
        """Start bit, data bits, parity bit, stop bits."""
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits

    def character_s(self, baud: int | None = None) -> float:
        """Return how long one character takes, in s, at `baud` or at the usual rate."""
        return self.bits_per_character / (baud or self.baud)

    @property
    def text(self) -> str:
        """The settings as people say them, for example `9600 baud, 7 data bits, even parity, 2 stop bits`."""
        stop = f"{self.stop_bits} stop bit" + ("s" if self.stop_bits > 1 else "")
        flow = "" if self.flow == "none" else f", flow control {self.flow}"
        return f"{self.baud} baud, {self.data_bits} data bits, {self.parity} parity, {stop}{flow}"


class Step(Schema):
    """One command of a start or stop sequence: bytes sent, the answer waited for, a rest afterwards."""

    send: Bytes = Field(min_length=1)
    reply: Bytes = b""
    wait_s: float = Field(default=0.0, ge=0.0, le=30.0)


class Ask(Schema):
    """How a reading is obtained: `request` before each, or the device streams by itself once it is started."""

    mode: Literal["request", "stream"]
    request: Bytes = b""
    start: tuple[Step, ...] = ()
    stop: tuple[Step, ...] = ()

    @model_validator(mode="after")
    def _request_fits(self) -> Ask:
        if (self.mode == "request") != bool(self.request):
            raise ValueError("mode request has request bytes, mode stream has none")
        return self


class Length(Schema):
    """The number on the wire as a length.

    Attributes:
        unit: of the number, unless a code in the frame names another one.
        mm_per_count: for unit `count`.
        sense: -1 where the number falls when the balls move apart.
        range_mm: lengths outside are reported as overrange.
        stroke_mm: travel of the gauge from the bar's calibrated length, either way; circles of other radii are refused.
    """

    unit: Unit = "mm"
    mm_per_count: float | None = Field(default=None, gt=0.0)
    sense: Literal[1, -1] = 1
    range_mm: tuple[float, float]
    stroke_mm: float | None = Field(default=None, gt=0.0)

    @model_validator(mode="after")
    def _count_has_size(self) -> Length:
        if (self.unit == "count") != (self.mm_per_count is not None):
            raise ValueError("unit count, and only it, needs mm_per_count")
        if self.range_mm[0] >= self.range_mm[1]:
            raise ValueError("range_mm is [lowest, highest]")
        return self

    def mm_per_unit(self, unit: Unit | None = None) -> float:
        """Return the factor from a number on the wire to mm, the sense included."""
        return self.sense * (self.mm_per_count or _MM_PER_UNIT[unit or self.unit])


class Frame(Schema):
    """One kind of frame: parts in wire order. A frame without a length is a message, and says what it means."""

    name: str = "reading"
    status: Status = "ok"
    means: str = ""
    remedy: str = ""
    parts: tuple[Part, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _makes_sense(self) -> Frame:
        kinds = [part.of for part in self.parts if isinstance(part, DecimalText | Integer | Ieee)]
        if kinds.count("length") > 1 or kinds.count("counter") > 1:
            raise ValueError("a frame has at most one length and one counter")
        if "length" not in kinds and (self.status == "ok" or not self.means):
            raise ValueError("a frame without a length is a message: give it a status that is not ok, and means")
        return self

    @property
    def number(self) -> DecimalText | Integer | Ieee | None:
        """The part that carries the length."""
        return self._number_of("length")

    @property
    def counter(self) -> DecimalText | Integer | Ieee | None:
        """The part that carries the sample counter."""
        return self._number_of("counter")

    def _number_of(self, what: str) -> DecimalText | Integer | Ieee | None:
        parts = (part for part in self.parts if isinstance(part, DecimalText | Integer | Ieee) and part.of == what)
        return next(parts, None)

    @property
    def width(self) -> int | None:
        """Bytes of the frame, None where they vary."""
        widths = [part.width for part in self.parts]
        return None if None in widths else sum(width for width in widths if width is not None)

    @property
    def terminator(self) -> bytes:
        """The fixed bytes at its end, empty where it ends otherwise."""
        last = self.parts[-1]
        return last.value if isinstance(last, Literally) else b""

    @property
    def binary(self) -> bool:
        """Whether bytes inside can look like a line end by chance."""
        return any(
            isinstance(part, Flags)
            or (isinstance(part, DecimalText | Integer | Ieee) and part.binary)
            or (isinstance(part, Checksum) and part.written == "binary")
            for part in self.parts
        )

    @cached_property
    def pattern(self) -> re.Pattern[bytes]:
        """The whole frame as a regular expression, one group per part."""
        return re.compile(b"".join(b"(" + part.pattern() + b")" for part in self.parts))

    @property
    def voices(self) -> tuple[Code | Bit, ...]:
        """Every code and bit with which this frame can speak of a status."""
        found: list[Code | Bit] = []
        for part in self.parts:
            if isinstance(part, Choice):
                found += part.codes
            elif isinstance(part, Flags):
                found += part.bits
            elif isinstance(part, DecimalText | Integer | Ieee):
                found += part.specials
        return tuple(voice for voice in found if voice.status != "ok")

    def read(self, match: re.Match[bytes]) -> Found:
        """Return what a match of `pattern` says.

        Raises:
            NotUnderstood: the characters are right but a number or the checksum is not.
        """
        found = Found()
        found.report(self.status, self.means, self.remedy)
        for group, part in enumerate(self.parts, start=1):
            if isinstance(part, Checksum):
                should = part.over(match.string[match.start() : match.start(group)])
                if match[group] != should:
                    raise NotUnderstood(f"checksum {match[group].hex(' ')} instead of {should.hex(' ')}")
            else:
                part.read(match[group], found)
        return found

    def write(self, content: Content) -> bytes:
        """Return the frame as bytes.

        Raises:
            NotRepresentable: a number does not fit.
        """
        number = self.number
        value = (number.rounded(content.value) if number else 0.0) + 0.0
        content = Content(value, content.counter, content.voice)
        unsigned = Content(abs(value), content.counter, content.voice)
        has_sign = any(isinstance(part, Sign) for part in self.parts)
        raw = b""
        for part in self.parts:
            if isinstance(part, Checksum):
                raw += part.over(raw)
            else:
                raw += part.write(content if isinstance(part, Sign) or not has_sign else unsigned)
        return raw


class Timing(Schema):
    """When things happen.

    Attributes:
        latch_delay_s: request: from the end of the request to the moment the device takes the length. Stream: from that
            moment to the first byte of the frame.
        reply_latency_s: from the end of the request to the first byte of the reply.
        rate_hz: readings per second: of a stream the nominal rate, of requests the most the device stands. None: as
            fast as replies come.
        timeout_s: patience before the line counts as silent.
        retries: how often in a row a request may stay without an answer that can be read.
    """

    latch_delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    reply_latency_s: float = Field(default=0.0, ge=0.0, le=10.0)
    rate_hz: float | None = Field(default=None, gt=0.0)
    timeout_s: float = Field(gt=0.0, le=60.0)
    retries: int = Field(default=2, ge=0, le=10)


class Reference(Schema):
    """Where a statement of the file comes from; `verified` says whether it was read there, not remembered."""

    says: str
    where: str
    verified: bool


class Protocol(Schema):
    """A whole protocol file.

    Attributes:
        name: what it is called on the command line; the file's name without `.yaml`.
        title: what it is.
        setup: what the operator sets on the device.
        references: manual pages.
    """

    format: Literal["dbb-instrument/1", "dbb-instrument/2"]
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    title: str = Field(min_length=1)
    setup: tuple[str, ...] = ()
    references: tuple[Reference, ...] = ()
    line: Line
    ask: Ask
    length: Length
    frames: tuple[Frame, ...] = Field(min_length=1)
    timing: Timing

    @model_validator(mode="after")
    def _frames_can_be_told_apart(self) -> Protocol:
        if self.frames[0].number is None or any(frame.number is not None for frame in self.frames[1:]):
            raise ValueError("the first frame, and only the first, carries the length")
        if not self.by_width and not self.terminator:
            raise ValueError(
                "every frame ends in the same literal, or every frame has a fixed width: otherwise nobody knows where one ends"
            )
        if self.line.data_bits == 7 and any(frame.binary for frame in self.frames):  # noqa: PLR2004 (bits)
            raise ValueError("binary parts need 8 data bits")
        if self.ask.mode == "stream" and self.timing.rate_hz is None:
            raise ValueError("a stream needs timing.rate_hz")
        return self

    @property
    def by_width(self) -> bool:
        """Whether frames are cut by their width (binary parts) instead of at the line end."""
        fixed = all(frame.width is not None for frame in self.frames)
        return fixed and (any(frame.binary for frame in self.frames) or not self.terminator)

    @property
    def terminator(self) -> bytes:
        """The line end that all frames share, empty where they have none."""
        ends = {frame.terminator for frame in self.frames}
        return ends.pop() if len(ends) == 1 else b""

    @property
    def counter_modulus(self) -> int | None:
        """Modulus of the sample counter, None where the wire has none."""
        counter = self.frames[0].counter
        return counter.modulus if counter else None

    def voice(self, status: Status) -> tuple[Frame, Code | Bit | None] | None:
        """Return how the device says `status`: a code in its reading, or else a message; None where it cannot."""
        reading = self.frames[0]
        for voice in reading.voices:
            if voice.status == status:
                return reading, voice
        return next(((frame, None) for frame in self.frames[1:] if frame.status == status), None)

    @property
    def statuses(self) -> tuple[Code | Bit | Frame, ...]:
        """Everything the device can say that is not ok, the worst first."""
        said = [*self.frames[0].voices, *self.frames[1:]]
        return tuple(sorted(said, key=lambda one: -SEVERITY[one.status]))

    @property
    def frame_characters(self) -> int:
        """Characters of a typical reading on the wire."""
        return len(self.frames[0].write(Content(0.0))) if self.frames[0].width is None else self.frames[0].width

    def fastest_hz(self, baud: int | None = None) -> float:
        """Return the most readings per second that the line carries, latency included; at most `rate_hz`."""
        character_s = self.line.character_s(baud)
        one_s = self.frame_characters * character_s
        if self.ask.mode == "request":
            one_s += len(self.ask.request) * character_s + self.timing.reply_latency_s
        return min(1.0 / one_s, self.timing.rate_hz or float("inf"))


__all__ = ["NotRepresentable", "NotUnderstood", "Part", "Protocol"]
