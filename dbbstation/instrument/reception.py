"""Common parts of polling and listening."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.instrument import symptoms
from dbbstation.instrument.codec import LONGEST_LINE

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.errors import InstrumentError
    from dbbstation.instrument.fields import Reason
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading

INCOMPLETE = "incomplete"
"""Reason for bytes that began a frame but did not complete it."""


@dataclass(slots=True)
class Tally:
    """Counts of readings and rejected bytes since `start`.

    Attributes:
        rejected: frames and stretches of bytes, by reason.
    """

    readings: int = 0
    lost: int = 0
    doubtful: int = 0
    rejected: dict[Reason, int] = field(default_factory=dict)
    garbage_bytes: int = 0
    garbage: bytes = b""
    reconnected: int = 0

    def reject(self, raw: bytes, reason: Reason) -> None:
        """Count rejected bytes."""
        if raw:
            self.rejected[reason] = self.rejected.get(reason, 0) + 1
            self.garbage_bytes += len(raw)
            self.garbage = self.garbage or raw[:LONGEST_LINE]


@dataclass(slots=True)
class Reception:
    """The state of a line while it is read.

    Attributes:
        clock: of readings [s].
        timeout_s: patience with a silent line, in real seconds.
        memory_s: how long a stream's quickest arrival counts, by the clock.
        eighth_bit_marks: the eighth bit of a seven-bit character can only mark wrong parity.
    """

    protocol: Protocol
    where: str
    baud: int
    clock: Callable[[], float]
    timeout_s: float
    memory_s: float
    put: Callable[[Reading], None]
    stop: threading.Event = field(default_factory=threading.Event)
    tally: Tally = field(default_factory=Tally)
    eighth_bit_marks: bool = False

    @property
    def character_s(self) -> float:
        """Return the time of a character [s]."""
        return self.protocol.line.character_s(self.baud)

    def symptom(self, raw: bytes, why: str) -> InstrumentError:
        """Return the error for a line without readings."""
        if not raw:
            heard_before = self.tally.readings > 0
            return symptoms.silence(self.protocol, self.where, self.timeout_s, self.baud, heard_before=heard_before)
        if why == INCOMPLETE and symptoms.begins_well(self.protocol, raw):
            return symptoms.half_line(raw, self.where, self.timeout_s)
        return symptoms.garbage(self.protocol, self.where, raw, why, self.baud, marked=self.eighth_bit_marks)
