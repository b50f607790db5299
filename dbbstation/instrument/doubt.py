"""Detect readings that fit the grammar but may be damaged, on lines without a checksum.

A device writes all numbers in one form: unit, decimals, and digits before the point as needed or zero-padded. A lost or
inserted digit, a moved point or another unit changes this form. Two changes of form are genuine:

- A number passes a power of ten. A number of d + 1 digits is at least 10^d. A digit lost before the point reduces it by
at least 0.8 of 10^d; an inserted digit adds as much. So a step below half of 10^d is genuine.
- The device was set to another form. All following lines then have the new form. If one line in a thousand is damaged, three in a
  row occur once in 10^9 lines (two years at 14 lines a second), so the third is accepted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.instrument.reading import DOUBTFUL, OK

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading

BELIEVED_AFTER = 3
"""Number of successive lines in another form after which it counts as the device's form."""

_TRUE_STEP = 0.5
"""Greatest genuine step across a power of ten, in units of this power; a lost digit changes the number by at least
0.8."""

_REMEDY = "look after the cable, its screen and connectors, and what switches motors beside it"


@dataclass(frozen=True, slots=True)
class Written:
    """A number as written on the wire.

    Attributes:
        before: digits before the point.
    """

    value: float
    before: int
    behind: int
    unit: str = ""

    def continues(self, last: Written) -> bool:
        """Return whether a device with unchanged settings can have written this number after `last`."""
        if (self.behind, self.unit) != (last.behind, last.unit):
            return False
        return self.before == last.before or self._passed_a_power_of_ten(last)

    def _passed_a_power_of_ten(self, last: Written) -> bool:
        wider, narrower = (self, last) if self.before > last.before else (last, self)
        place = 10.0**narrower.before
        # A wider number with zeros in front has passed nothing.
        whole = wider.before == narrower.before + 1 and abs(wider.value) >= place
        return whole and abs(self.value - last.value) < _TRUE_STEP * place

    def difference(self, last: Written) -> str:
        """Return the difference of form from `last`, in words."""
        if self.unit != last.unit:
            return f"its unit is {self.unit}, that of the lines before was {last.unit}"
        count, place, of = self.behind, "behind", last.behind
        if count == of:
            count, place, of = self.before, "before", last.before
        digits = "digit" if count == 1 else "digits"
        return f"its number has {count} {digits} {place} the point, the lines before had {of}"


@dataclass(frozen=True, slots=True)
class Piece:
    """A reading without time and losses, with its bytes.

    Attributes:
        written: its number; None without decimal digits.
    """

    reading: Reading
    raw: bytes
    after: int
    written: Written | None = None


class Doubts:
    """Marks doubtful readings of one line.

    Args:
        protocol: with a checksum nothing is doubtful.
    """

    def __init__(self, protocol: Protocol) -> None:
        self._proved = protocol.has_checksum
        self._form: Written | None = None
        self._other: Written | None = None
        self._others = 0

    def judged(self, piece: Piece, *, clean: bool = True) -> Reading:
        """Return a reading, marked if doubtful."""
        reading, written = piece.reading, piece.written
        if self._proved:
            return reading
        why = "" if written is None else self._unlike(written)
        if not clean:
            why = why or "bytes that belong to no reply came with it"
        if not why or reading.status != OK:
            return reading
        return replace(reading, status=DOUBTFUL, said=f"{why}: a character was damaged or lost", remedy=_REMEDY)

    def _unlike(self, written: Written) -> str:
        """Return how a number's form changed; empty if it did not change, or if the new form is now the device's."""
        last = self._form
        if last is None or written.continues(last):
            self._form, self._others = written, 0
            return ""
        repeated = self._others and self._other is not None and written.continues(self._other)
        self._other, self._others = written, self._others + 1 if repeated else 1
        if self._others >= BELIEVED_AFTER:
            self._form, self._others = written, 0
            return ""
        return written.difference(last)
