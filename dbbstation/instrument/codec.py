"""Convert bytes to readings and back by a protocol's grammar, without port or clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.errors import InstrumentError
from dbbstation.instrument.damaged import damaged_in
from dbbstation.instrument.doubt import Piece, Written
from dbbstation.instrument.fields import Content, FrameParts, NotRepresentable, NotUnderstood, Reason
from dbbstation.instrument.reading import Reading, Status

if TYPE_CHECKING:
    from dbbstation.instrument.frame import Frame
    from dbbstation.instrument.protocol import Protocol

LONGEST_LINE = 256
"""Number of bytes without a line end that count as garbage; no known length gauge sends longer lines. It is also the
greatest number of kept bytes without a frame of fixed width."""


@dataclass(frozen=True, slots=True)
class Garbage:
    """Bytes that are not understood.

    Attributes:
        why: fault, or empty if they do not fit the grammar.
        joining: end of a frame that began before listening, which is no fault.
    """

    raw: bytes
    why: str = ""
    joining: bool = False
    reason: Reason = "bytes"


Heard: TypeAlias = Piece | Garbage


def encode(protocol: Protocol, length_mm: float | None, *, counter: int = 0) -> bytes:
    """Return the bytes of one sample.

    Args:
        length_mm: None: no length, reported as `fault`. A length that does not fit becomes `overrange`, or `fault` if the
            device has no such status.
        counter: taken modulo the wire's modulus.

    Raises:
        InstrumentError: the protocol cannot express it.
    """
    length, features = protocol.length, protocol.features
    told: tuple[Status, ...] = ("fault",)
    if length_mm is not None:
        value = (length_mm - length.zero_mm) / length.mm_per_unit()
        try:
            return protocol.frames[0].write(Content(value, counter, features=features))
        except NotRepresentable:
            told = ("overrange", "fault")
    for wanted in told:
        voice = protocol.voice(wanted)
        if voice is not None:
            return _told(voice[0], Content(0.0, counter, voice[1], features))
    raise InstrumentError(
        f"its protocol cannot express {told[0]!r}",
        where=protocol.name,
        remedy="give this status to a code, a special or a message frame of the protocol file",
    )


def decode(protocol: Protocol, raw: bytes) -> Reading:
    """Return the reading that exactly these bytes contain, without time and losses.

    Raises:
        NotUnderstood: they are no whole frame of this protocol.
    """
    return _decoded(protocol, raw)[0]


def _decoded(protocol: Protocol, raw: bytes) -> tuple[Reading, Written | None]:
    wrong = NotUnderstood("no frame of this protocol")
    for frame in protocol.frames:
        match = frame.pattern.fullmatch(raw)
        if match is not None:
            try:
                return _reading(protocol, frame.read(match))
            except NotUnderstood as error:
                wrong = error
    raise wrong


class Decoder:
    """Cuts a byte stream into frames and decodes them; chunks may end anywhere."""

    def __init__(self, protocol: Protocol, *, joining: bool) -> None:
        self._protocol = protocol
        self._joining = joining
        self._in_step = not joining
        self.pending = b""
        self._heads = [frame.literal(0) for frame in protocol.frames]
        self._bare = tuple(frame.write(Content(0.0)) for frame in protocol.frames if frame.bare)

    def take_pending(self) -> bytes:
        """Return and clear the pending bytes."""
        raw, self.pending = self.pending, b""
        return raw

    def feed(self, chunk: bytes) -> list[Heard]:
        """Return the readings and garbage that `chunk` completed, in wire order."""
        self.pending += chunk
        return self._cut_by_width() if self._protocol.by_width else self._cut_by_line_end()

    def _cut_by_line_end(self) -> list[Heard]:
        end = self._protocol.terminator
        heard: list[Heard] = []
        while True:
            bare = next((raw for raw in self._bare if self.pending.startswith(raw)), None)
            if bare is not None:
                raw = bare
            else:
                cut = self.pending.find(end)
                if cut < 0:
                    break
                raw = self.pending[: cut + len(end)]
            self.pending = self.pending[len(raw) :]
            joining, self._joining = self._joining, False
            if joining and bare is None:
                # Its beginning is unknown: where widths vary, "23.4" may be the rest of "123.4".
                heard.append(Garbage(raw, joining=True))
                continue
            try:
                reading, written = _decoded(self._protocol, raw)
                heard.append(Piece(reading, raw, len(self.pending), written))
            except NotUnderstood as error:
                heard.append(self._not_understood(raw, error))
        if len(self.pending) > LONGEST_LINE:
            heard.append(Garbage(self.take_pending(), f"no line end in {LONGEST_LINE} bytes"))
        return heard

    def _not_understood(self, raw: bytes, error: NotUnderstood) -> Garbage:
        damaged = damaged_in(raw, self._protocol.line)
        if not damaged:
            return Garbage(raw, str(error), reason=error.reason)
        characters = "character" if damaged == 1 else "characters"
        return Garbage(raw, f"{damaged} {characters} with a wrong parity", reason="parity")

    def _cut_by_width(self) -> list[Heard]:
        """Move on to the next frame that fits. After a loss of synchronisation two successive frames must fit."""
        longest = max(frame.width or 0 for frame in self._protocol.frames)
        heard: list[Heard] = []
        start = skipped = 0
        wrong: NotUnderstood | None = None
        while len(self.pending) - start - skipped >= longest:
            here = start + skipped
            found = self._frame_at(here)
            if isinstance(found, NotUnderstood):
                wrong, found = wrong or found, None
            if found is not None and not self._in_step:
                follower = here + len(found.raw)
                if len(self.pending) - follower < longest:
                    break
                found = found if isinstance(self._frame_at(follower), Piece) else None
            if found is None:
                self._in_step = False
                skipped = self._next_head(here + 1, len(self.pending) - longest + 1) - start
                continue
            if skipped:
                heard.append(_skipped(self.pending[start:here], wrong, joining=self._joining))
            heard.append(found)
            start, skipped, wrong = here + len(found.raw), 0, None
            self._in_step, self._joining = True, False
        if skipped and (not self._joining or skipped > LONGEST_LINE):
            heard.append(_skipped(self.pending[start : start + skipped], wrong, joining=False))
            start += skipped
        self.pending = self.pending[start:]
        return heard

    def _next_head(self, after: int, end: int) -> int:
        """Return the next place before `end` where the first bytes of a frame may be."""
        if not all(self._heads):
            return after
        places = [self.pending.find(head, after, end + len(head) - 1) for head in self._heads]
        return min((place for place in places if place >= 0), default=max(after, end))

    def _frame_at(self, start: int) -> Piece | NotUnderstood | None:
        wrong: NotUnderstood | None = None
        for frame in self._protocol.frames:
            match = frame.pattern.match(self.pending, start)
            if match is not None:
                try:
                    reading, written = _reading(self._protocol, frame.read(match))
                except NotUnderstood as error:
                    wrong = error
                    continue
                return Piece(reading, match[0], len(self.pending) - match.end(), written)
        return wrong


def _skipped(raw: bytes, wrong: NotUnderstood | None, *, joining: bool) -> Garbage:
    return Garbage(raw, joining=joining) if wrong is None else Garbage(raw, str(wrong), joining, wrong.reason)


def _reading(protocol: Protocol, found: FrameParts) -> tuple[Reading, Written | None]:
    length_mm: float | None = None
    if found.value is not None and found.status != "fault":
        length_mm = found.sign * found.value * protocol.length.mm_per_unit(found.unit) + protocol.length.zero_mm + 0.0
        low_mm, high_mm = protocol.length.range_mm
        if not low_mm <= length_mm <= high_mm:
            found.report(
                "overrange",
                f"{length_mm:g} mm is outside its range {low_mm:g} to {high_mm:g} mm",
                "check unit and preset of the instrument, and the bar's working length",
            )
    if length_mm is None and found.status == "ok":
        raise NotUnderstood("no number and no status")
    written = None
    # What a device writes in place of a length, such as zeros, says nothing of how it writes lengths.
    if found.value is not None and found.digits is not None and length_mm is not None:
        written = Written(found.sign * found.value, *found.digits, found.unit or "")
    return Reading(0.0, length_mm, found.status, 0, found.counter, found.said, found.remedy), written


def _told(frame: Frame, content: Content) -> bytes:
    try:
        return frame.write(content)
    except NotRepresentable:
        return frame.write(content.of(0.0))
