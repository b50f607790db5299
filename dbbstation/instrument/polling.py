"""Read an instrument by request."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import TYPE_CHECKING

from dbbstation.instrument.codec import LONGEST_LINE, Decoder, Garbage
from dbbstation.instrument.doubt import Doubts, Piece
from dbbstation.instrument.reading import Reading
from dbbstation.instrument.reception import INCOMPLETE
from dbbstation.instrument.sequence import SampleOrder
from dbbstation.instrument.stamps import MachineTime

if TYPE_CHECKING:
    from dbbstation.instrument.codec import Heard
    from dbbstation.instrument.link import Link
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reception import Reception


@dataclass(frozen=True, slots=True)
class Latch:
    """Moment at which a device measured a length.

    Attributes:
        t_s: most likely, by the host's clock.
    """

    t_s: float
    uncertainty_s: float


def latch_of(protocol: Protocol, *, asked_s: float, first_byte_s: float, baud: int) -> Latch:
    """Return when the device measured the length of a reply.

    The moment is distributed uniformly between the device's bounds, before the reply. The estimate is the middle, and
    the standard uncertainty is the width over √12 [JCGM 100:2008, 4.3.7]. The computer delays late replies, mostly on
    arrival. The estimate is then kept, and the uncertainty includes a delayed request. A reply earlier than possible
    refutes the bounds; the moment is then anywhere between request and first byte.
    """
    character_s = protocol.line.character_s(baud)
    sent_s = asked_s + len(protocol.ask.request) * character_s
    earliest_s, latest_s = (sent_s + bound for bound in protocol.latch_bounds_s())
    replied_s = first_byte_s - character_s
    if replied_s <= earliest_s:
        return Latch((asked_s + first_byte_s) / 2.0, (first_byte_s - asked_s) / sqrt(12.0))
    latest_s = min(latest_s, replied_s)
    t_s = (earliest_s + latest_s) / 2.0
    held_up_s = max(0.0, replied_s - sent_s - protocol.timing.reply_latency_s)
    last_s = min(latest_s + held_up_s, replied_s)
    return Latch(t_s, hypot((last_s - earliest_s) / sqrt(12.0), (earliest_s + last_s) / 2.0 - t_s))


_PAUSE_TICK_S = 0.001

_MARGIN_S = 0.02
"""Time that is added to the duration of a reply before the line counts as quiet [s]."""

EXCHANGES = 20
"""Number of last requests over which disturbed replies are counted."""

MOST_NOISY = 7
"""If so many of these requests get bytes outside a reply, the cause is not noise but another instrument, whose replies
are cut at the wrong places. If one exchange in twenty is disturbed, so many occur once in 30 000 times (binomial)."""


@dataclass(frozen=True, slots=True)
class PolledReply:
    """The answer to a request.

    Attributes:
        heard: reply, or garbage until patience ended.
        raw: all bytes, in wire order.
    """

    heard: Heard
    first_s: float
    raw: bytes

    @property
    def clean(self) -> bool:
        """Return whether only the reply arrived."""
        return isinstance(self.heard, Piece) and self.heard.raw == self.raw


class Poller:
    """Requests readings until stopped."""

    def __init__(self, link: Link, reception: Reception) -> None:
        self._link = link
        self._to = reception
        self._protocol = reception.protocol
        self._sequence = SampleOrder[tuple[Piece, Reading]](self._protocol.counter_modulus, reception.where)
        self._doubts = Doubts(self._protocol)
        self._last_s = float("-inf")
        self._failed: list[Garbage] = []
        self._recent: deque[PolledReply] = deque(maxlen=EXCHANGES)
        self._explained = ""

    def run(self) -> None:
        """Read until `stop` is set.

        Raises:
            InstrumentError: the line is silent, closed or garbled, or the device restarted; OutputError: the byte log is full.
        """
        rate_hz, clock, stop = self._protocol.timing.rate_hz, self._to.clock, self._to.stop
        pause_s = 1.0 / rate_hz if rate_hz and not isinstance(clock, MachineTime) else 0.0
        self._until_quiet()
        while not stop.is_set():
            asked_s = clock.stamp(0.0) if isinstance(clock, MachineTime) else clock()
            self._link.write(self._protocol.ask.request)
            answer = self._answer(self._protocol)
            if stop.is_set():
                return
            self._recent.append(answer)
            if isinstance(answer.heard, Garbage):
                self._fail(answer.heard)
                continue
            judged = self._doubts.judged(answer.heard, clean=answer.clean)
            self._take(replace(answer.heard, reading=judged), self._seen_s(answer, asked_s), asked_s)
            self._refuse_strangers()
            while clock() < asked_s + pause_s and not stop.wait(_PAUSE_TICK_S):
                pass

    def _seen_s(self, answer: PolledReply, asked_s: float) -> float:
        """Return the arrival time of the reply's first byte; if time is counted, the earliest possible time."""
        if not isinstance(self._to.clock, MachineTime):
            return answer.first_s
        characters = len(self._protocol.ask.request) + 1
        return asked_s + characters * self._to.character_s + self._protocol.timing.reply_latency_s

    def _take(self, heard: Piece, first_s: float, asked_s: float) -> None:
        latch = latch_of(self._protocol, asked_s=asked_s, first_byte_s=first_s, baud=self._to.baud)
        self._last_s = max(latch.t_s, self._last_s + 1e-6)
        reading = replace(heard.reading, t_s=self._last_s, t_uncertainty_s=latch.uncertainty_s)
        if reading.status == "fault":
            # Asked once: while the fault lasts the words stay the same.
            self._explained = self._explained or self._explanation() or reading.said
            reading = replace(reading, said=self._explained)
        else:
            self._explained = ""
        for placed in self._sequence.place(reading.counter, (heard, reading)):
            piece, one = placed.sample
            if placed.lost is None:
                self._to.tally.reject(piece.raw, "counter")
            else:
                self._to.put(replace(one, lost=placed.lost if self._sequence.counts else len(self._failed)))
        self._failed.clear()

    def _fail(self, heard: Garbage) -> None:
        self._failed.append(heard)
        self._to.tally.reject(heard.raw, heard.reason)
        self._until_quiet()
        self._refuse_strangers()
        if len(self._failed) > self._protocol.timing.retries:
            # The attempt that brought something says more than the silence after it.
            telling = next((one for one in reversed(self._failed) if one.raw), heard)
            raise self._to.symptom(telling.raw, telling.why)

    def _refuse_strangers(self) -> None:
        """Fail if foreign bytes recur: the replies then come from another instrument."""
        noisy = [answer for answer in self._recent if answer.raw and not answer.clean]
        if len(noisy) >= MOST_NOISY:
            raw = b"".join(answer.raw for answer in self._recent)[-LONGEST_LINE:]
            raise self._to.symptom(
                raw, f"{len(noisy)} of {len(self._recent)} exchanges contain bytes that belong to no reply"
            )

    def _explanation(self) -> str:
        follow_up, protocol = self._protocol.ask.follow_up, self._protocol.explaining
        if follow_up is None or protocol is None:
            return ""
        self._link.write(follow_up.request)
        heard = self._answer(protocol).heard
        if isinstance(heard, Garbage):
            self._to.tally.reject(heard.raw, heard.reason)
            return ""
        # Only the first of the frames has words; the others say that there are none.
        return heard.reading.said if protocol.frames[0].pattern.fullmatch(heard.raw) else ""

    def _until_quiet(self) -> None:
        """Discard replies to earlier requests until the line is quiet for the time of a reply."""
        quiet_s = self._protocol.timing.reply_latency_s + _MARGIN_S
        quiet_s += self._protocol.frame_characters * self._to.character_s
        now_s = heard_s = time.monotonic()
        end_s = now_s + self._to.timeout_s + quiet_s
        while now_s < min(heard_s + quiet_s, end_s) and not self._to.stop.is_set():
            raw = self._link.read()
            now_s = time.monotonic()
            heard_s = now_s if raw else heard_s
            self._to.tally.reject(raw, "bytes")

    def _answer(self, protocol: Protocol) -> PolledReply:
        decoder = Decoder(protocol, joining=False)
        deadline_s = time.monotonic() + self._to.timeout_s
        first_s, came = 0.0, b""
        while time.monotonic() < deadline_s and not self._to.stop.is_set():
            raw = self._link.read()
            if raw and not came:
                first_s = self._to.clock() - (len(raw) - 1) * self._to.character_s
            came = (came + raw)[: 2 * LONGEST_LINE]
            heard = decoder.feed(raw)
            pieces = [one for one in heard if isinstance(one, Piece)]
            if pieces:
                noise = b"".join(one.raw for one in heard if isinstance(one, Garbage)) + decoder.take_pending()
                self._to.tally.reject(noise, "bytes")
                return PolledReply(pieces[-1], first_s, came)
            if heard and not decoder.pending:
                # A whole line that is no reading: asking again is quicker than waiting.
                return PolledReply(heard[-1], first_s, came)
        return PolledReply(Garbage(decoder.take_pending(), INCOMPLETE), first_s, came)
