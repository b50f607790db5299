"""When a polled device took its length, by manual and reply."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol


@dataclass(frozen=True, slots=True)
class Latch:
    """Moment of a length.

    Attributes:
        t_s: most likely, by the host's clock.
    """

    t_s: float
    uncertainty_s: float


def latch_of(protocol: Protocol, *, asked_s: float, first_byte_s: float, baud: int) -> Latch:
    """Return when the length of a reply was taken.

    The moment is uniform between the device's bounds and before the reply: its middle, with the width over the root of
    12 as standard uncertainty [JCGM 100:2008, 4.3.7]. A late reply was delayed by the computer, mostly on arrival, so
    the estimate is kept and the uncertainty includes a delayed request. A reply earlier than possible refutes the
    bounds; then the moment is anywhere between request and first byte.
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
