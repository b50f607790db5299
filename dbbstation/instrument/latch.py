"""When a device that is asked took its length: bounds from its manual, and what the reply says about them."""

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
        t_s: the likeliest, by the host's clock [s].
    """

    t_s: float
    uncertainty_s: float


def latch_of(protocol: Protocol, *, asked_s: float, first_byte_s: float, baud: int) -> Latch:
    """Return when the length was taken that a reply tells.

    The moment lies anywhere between the bounds of the device, and never behind the reply: a rectangle, whose middle is the
    estimate and whose width over the root of 12 the standard uncertainty [JCGM 100:2008, 4.3.7]. A reply that came later than
    the device may take was held up by the computer, on its way out or on its way in. Most is held up on its way in
    (adapters collect bytes), so the estimate stays; the uncertainty takes in the other. A reply that came before the stated line
    could carry it says that its times do not hold: the moment lies anywhere between asking and the first byte.

    Args:
        asked_s: when the request was handed to the system.
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
