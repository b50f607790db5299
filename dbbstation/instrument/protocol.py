"""The wire protocol of a length instrument, `dbb-instrument/1`: the content of a YAML file in `protocols/instruments`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, StringConstraints

from dbbstation.files.yaml.schema import Rules, Schema
from dbbstation.instrument.fields import Bytes, Content, Literally, Unit
from dbbstation.instrument.frame import Frame  # noqa: TC001 (pydantic needs it at run time)
from dbbstation.instrument.reading import SEVERITY, Status

if TYPE_CHECKING:
    from dbbstation.instrument.fields import Bit, Code

Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9.-]*$")]
"""Of an instrument or a profile: small letters, digits, hyphens, points."""

_MM_PER_UNIT: dict[Unit, float] = {"mm": 1.0, "um": 1e-3, "nm": 1e-6, "m": 1e3, "inch": 25.4}


class LineSettings(Schema):
    """Settings of the serial line; `baud_choices` are the rates that the device can be set to."""

    baud: int = Field(gt=0)
    baud_choices: tuple[int, ...] = ()
    data_bits: Literal[7, 8] = 8
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1
    flow: Literal["none", "rts-cts", "xon-xoff"] = "none"

    @property
    def bits_per_character(self) -> int:
        """Return the bits of a character with start, parity and stop."""
        return 1 + self.data_bits + (self.parity != "none") + self.stop_bits

    def character_s(self, baud: int | None = None) -> float:
        """Return the time of one character at `baud` or the usual rate [s]."""
        return self.bits_per_character / (baud or self.baud)

    @property
    def bits_text(self) -> str:
        """Return a character's bits, such as `7 data bits, even parity, 2 stop bits`."""
        stop = f"{self.stop_bits} stop bit" + ("s" if self.stop_bits > 1 else "")
        parity = "no" if self.parity == "none" else self.parity
        return f"{self.data_bits} data bits, {parity} parity, {stop}"

    @property
    def text(self) -> str:
        """Return the settings, such as `9600 baud, 7 data bits, even parity, 2 stop bits`."""
        flow = "" if self.flow == "none" else f", flow control {self.flow}"
        return f"{self.baud} baud, {self.bits_text}{flow}"


class LineCommand(Schema):
    """One command of a start or stop sequence: the bytes to send, the expected answer, and a pause.

    Attributes:
        refused: the answer of a device that does not know the command or does not allow it.
    """

    send: Bytes = Field(min_length=1)
    reply: Bytes = b""
    refused: Bytes = b""
    wait_s: float = Field(default=0.0, ge=0.0, le=30.0)


class FollowUp(Schema):
    """A request that is sent once after a fault, to read the device's message.

    Attributes:
        frames: the first is the answer while there is a fault, others are answers without a fault. All are messages.
    """

    request: Bytes = Field(min_length=1)
    frames: tuple[Frame, ...] = Field(min_length=1)

    def _rules(self) -> Rules:
        told = all(frame.is_message for frame in self.frames)
        yield not told, "a reply after a fault is a message without a length"


class Ask(Schema):
    """How a reading is obtained.

    Attributes:
        mode: `poll`: `request` before each; the device takes the length whenever it likes before it replies. `latch`: the request
            makes it take the length, within `timing.latch_bounds_s`. `stream`: it sends by itself once it is started.
    """

    mode: Literal["poll", "latch", "stream"]
    request: Bytes = b""
    request_end: Bytes = b""
    start: tuple[LineCommand, ...] = ()
    stop: tuple[LineCommand, ...] = ()
    follow_up: FollowUp | None = None

    def _rules(self) -> Rules:
        yield self.asked != bool(self.request), "modes poll and latch have request bytes, stream does not"
        told = self.follow_up is not None and not self.asked
        yield told, "a streaming device takes no requests, also after a fault"

    @property
    def asked(self) -> bool:
        """Return whether each reading is requested."""
        return self.mode != "stream"


class Reply(Schema):
    """Common parts of all replies, so that a profile changes them in one place."""

    prefix: Bytes = b""
    end: Bytes = b""

    def around(self, frame: Frame) -> Frame:
        """Return a frame with prefix and end; a bare frame stays unchanged."""
        if frame.bare:
            return frame
        before = (Literally(kind="literal", value=self.prefix),) if self.prefix else ()
        after = (Literally(kind="literal", value=self.end),) if self.end else ()
        return frame.model_copy(update={"parts": (*before, *frame.parts, *after)})


class Length(Schema):
    """The number on the wire as a length.

    Attributes:
        unit: of the number, unless a code in the frame names another one.
        sense: -1 where the number falls when the balls move apart.
        range_mm: lengths outside are reported as overrange.
        stroke_mm: travel of the gauge from the bar's calibrated length, either way; circles of other radii are refused.
        relative: the device shows how far it is from its zero, because its display has no room for the bar's length.
        zero_mm: distance of the ball centres at which a relative device shows zero.
    """

    unit: Unit = "mm"
    mm_per_count: float | None = Field(default=None, gt=0.0)
    sense: Literal[1, -1] = 1
    range_mm: tuple[float, float]
    stroke_mm: float | None = Field(default=None, gt=0.0)
    relative: bool = False
    zero_mm: float = 0.0

    def _rules(self) -> Rules:
        has_size = self.mm_per_count is not None
        yield (self.unit == "count") != has_size, "give mm_per_count with the unit count only"
        yield self.range_mm[0] >= self.range_mm[1], "range_mm is [lowest, highest]"
        yield self.zero_mm and not self.relative, "zero_mm goes with relative: true"

    def mm_per_unit(self, unit: Unit | None = None) -> float:
        """Return the factor to mm, with the sense."""
        return self.sense * (self.mm_per_count or _MM_PER_UNIT[unit or self.unit])


class Timing(Schema):
    """Times of the protocol.

    Attributes:
        latch_delay_s: asked: from the end of the request to the moment the device takes the length. Stream: from that
            moment to the first byte of the frame.
        latch_bounds_s: asked: the earliest and the latest moment of taking the length after the end of the request, where
            the manual has them; instead of `latch_delay_s`.
        reply_latency_s: from the end of the request to the first byte of the reply, at the latest.
        rate_hz: readings per second: of a stream the nominal rate, of requests the most the device stands. None: as
            fast as replies come.
        timeout_s: patience before the line counts as silent.
        retries: how often in a row a request may stay without an answer that can be read.
    """

    latch_delay_s: float = Field(default=0.0, ge=0.0, le=1.0)
    latch_bounds_s: tuple[float, float] | None = None
    reply_latency_s: float = Field(default=0.0, ge=0.0, le=10.0)
    rate_hz: float | None = Field(default=None, gt=0.0)
    timeout_s: float = Field(gt=0.0, le=60.0)
    retries: int = Field(default=2, ge=0, le=10)

    def _rules(self) -> Rules:
        if self.latch_bounds_s is not None:
            earliest_s, latest_s = self.latch_bounds_s
            remedy = "write latch_bounds_s as [earliest, latest], both at least 0, and leave latch_delay_s out"
            yield not 0.0 <= earliest_s <= latest_s or self.latch_delay_s, remedy


class Reference(Schema):
    """Source of a statement in the file; `verified` is true if the source was read."""

    says: str
    where: str
    verified: bool


class Protocol(Schema):
    """A whole protocol.

    Attributes:
        name: what it is called on the command line; the file's name without `.yaml`.
        profile: which variant of the device this is; empty where the file has no variants.
        setup: what the operator sets on the device.
        features: what the virtual instrument has switched on, of the features that optional parts name.
    """

    format: Literal["dbb-instrument/1"]
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    title: str = Field(min_length=1)
    profile: Name | Literal[""] = ""
    setup: tuple[str, ...] = ()
    references: tuple[Reference, ...] = ()
    features: tuple[str, ...] = ()
    line: LineSettings
    ask: Ask
    reply: Reply = Reply()
    length: Length
    frames: tuple[Frame, ...] = Field(min_length=1)
    timing: Timing

    def _rules(self) -> Rules:
        alone = not self.frames[0].is_message and all(frame.is_message for frame in self.frames[1:])
        yield not alone, "only the first frame carries the length"
        whole = self.whole()
        ends = "every frame ends in the same literal, or every frame has a fixed width"
        yield not (whole.by_width or whole.terminator), f"{ends}: otherwise the end of a frame is unknown"
        seven = self.line.data_bits == 7  # noqa: PLR2004 (bits)
        yield seven and any(frame.binary for frame in whole.frames), "binary parts need 8 data bits"
        yield self.ask.mode == "stream" and self.timing.rate_hz is None, "a stream needs timing.rate_hz"

    def whole(self) -> Protocol:
        """Return the protocol with the common parts inserted into requests and replies."""
        ask, end = self.ask, self.ask.request_end
        steps = {
            key: tuple(step.model_copy(update={"send": step.send + end}) for step in getattr(ask, key))
            for key in ("start", "stop")
        }
        follow_up = ask.follow_up
        if follow_up is not None:
            told = tuple(map(self.reply.around, follow_up.frames))
            follow_up = follow_up.model_copy(update={"request": follow_up.request + end, "frames": told})
        request = ask.request + end if ask.request else b""
        asking = {"request": request, "request_end": b"", "follow_up": follow_up, **steps}
        frames = tuple(map(self.reply.around, self.frames))
        return self.model_copy(update={"ask": ask.model_copy(update=asking), "frames": frames, "reply": Reply()})

    @property
    def label(self) -> str:
        """Return name and profile as text for people."""
        return f"{self.name} (profile {self.profile})" if self.profile else self.name

    @property
    def by_width(self) -> bool:
        """Return whether frames are cut by width (binary) instead of line end."""
        fixed = all(frame.width is not None for frame in self.frames)
        return fixed and (any(frame.binary for frame in self.frames) or not self.terminator)

    @property
    def terminator(self) -> bytes:
        """Return the line end of all frames that are not bare; may be empty."""
        ends = {frame.literal(-1) for frame in self.frames if not frame.bare}
        return ends.pop() if len(ends) == 1 else b""

    @property
    def counter_modulus(self) -> int | None:
        """Return the counter's modulus, or None."""
        counter = self.frames[0].counter
        return counter.modulus if counter else None

    @property
    def explaining(self) -> Protocol | None:
        """Return the protocol of the request after a fault, or None."""
        follow_up = self.ask.follow_up
        return None if follow_up is None else self.model_copy(update={"frames": follow_up.frames})

    @property
    def has_checksum(self) -> bool:
        """Return whether a checksum detects wrong digits."""
        return any(part.kind == "checksum" for part in self.frames[0].parts)

    @property
    def is_text(self) -> bool:
        """Return whether all frames are text."""
        return not any(frame.binary for frame in self.frames)

    def voice(self, status: Status) -> tuple[Frame, Code | Bit | None] | None:
        """Return the code of a status, else its message, or None."""
        for frame in self.frames:
            for voice in frame.voices:
                if voice.status == status:
                    return frame, voice
        return next(((frame, None) for frame in self.frames[1:] if frame.status == status), None)

    @property
    def statuses(self) -> tuple[Code | Bit | Frame, ...]:
        """Return all bad statuses of the device, the worst first."""
        said: list[Code | Bit | Frame] = list(self.frames[0].voices)
        for frame in self.frames[1:]:
            said += frame.voices or (frame,)
        return tuple(sorted(said, key=lambda one: -SEVERITY[one.status]))

    @property
    def frame_characters(self) -> int:
        """Return the number of characters of a typical reading."""
        width = self.frames[0].width
        return len(self.frames[0].write(Content(0.0, features=self.features))) if width is None else width

    def fastest_hz(self, baud: int | None = None) -> float:
        """Return the greatest rate of readings that the line allows with latency, at most `rate_hz`."""
        character_s = self.line.character_s(baud)
        one_s = self.frame_characters * character_s
        if self.ask.asked:
            one_s += len(self.ask.request) * character_s + self.timing.reply_latency_s
        return min(1.0 / one_s, self.timing.rate_hz or float("inf"))

    def latch_bounds_s(self) -> tuple[float, float]:
        """Return the earliest and latest time of latching after the request [s].

        A polled device without bounds latches at any time before its reply.
        """
        timing = self.timing
        if timing.latch_bounds_s is not None:
            return timing.latch_bounds_s
        if self.ask.mode == "poll":
            return 0.0, timing.reply_latency_s
        return timing.latch_delay_s, timing.latch_delay_s
