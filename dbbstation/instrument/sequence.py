"""Detect lost samples and counters out of order by the device's sample counter.

After a damaged or doubled line the counter continues from the line before. After a loss it is larger, after a restart
smaller. The driver therefore keeps the line until it has read the next lines. The next lines continue a damaged counter
only if two successive lines are damaged and their counters match by chance. With one damaged line in a thousand and
modulus 256, the probability is one in 250 million.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from dbbstation.errors import InstrumentError

Held = TypeVar("Held")

GAP_FOLLOWERS = 1
"""Number of lines that must continue from a larger counter before samples count as lost."""

RESTART_FOLLOWERS = 2
"""Number of lines that must continue from a smaller counter before a restart is assumed. A restart ends a measurement
and a gap does not, so it needs one line more."""


@dataclass(frozen=True, slots=True)
class Placed(Generic[Held]):
    """A sample with its position in the sequence.

    Attributes:
        lost: number missing before it; None: the sample is rejected.
    """

    sample: Held
    lost: int | None
    why: str = ""


class SampleOrder(Generic[Held]):
    """Orders samples by counter and returns them in wire order, doubtful samples with a delay."""

    def __init__(self, modulus: int | None, where: str) -> None:
        self._modulus = modulus
        self._where = where
        self._last: int | None = None
        self._held: list[tuple[int, Held]] = []

    @property
    def counts(self) -> bool:
        """Return whether the wire has a counter."""
        return self._modulus is not None

    def place(self, counter: int | None, sample: Held) -> list[Placed[Held]]:
        """Add the next sample and return the samples whose position is now known.

        Raises:
            InstrumentError: the device restarted. Earlier samples were returned; held ones are in `left`.
        """
        if self._modulus is None or counter is None:
            return [Placed(sample, 0)]
        if self._last is None or (self._step(self._last, counter) == 1 and not self._held):
            self._last = counter
            return [Placed(sample, 0)]
        if self._held and self._goes_on_from_before(counter):
            return [*self.left(), *self._accepted([(counter, sample)])]
        if self._held and not self._ahead(self._held[-1][0], counter):
            rejected = self.left()
            self._held = [(counter, sample)]
            return rejected
        self._held.append((counter, sample))
        return self._decided()

    def _goes_on_from_before(self, counter: int) -> bool:
        last = self._last or 0
        if not self._ahead(last, counter):
            return False
        return self._step(last, counter) <= len(self._held) + 1 or not self._ahead(self._held[-1][0], counter)

    def _decided(self) -> list[Placed[Held]]:
        first, followers = self._held[0][0], len(self._held) - 1
        if self._ahead(self._last or 0, first):
            return self._accepted(self._held) if followers >= GAP_FOLLOWERS else []
        if self._step(self._held[-2][0], self._held[-1][0]) != 1 if followers else False:
            # Behind, and not counting on: damaged lines in a row.
            *damaged, newest = self._held
            self._held = damaged
            rejected = self.left()
            self._held = [newest]
            return rejected
        if followers >= RESTART_FOLLOWERS:
            self._held.pop()
            raise InstrumentError(
                f"the sample counter went from {self._last} to {first} and continues from there",
                where=self._where,
                remedy="the instrument was restarted, or another program reads the same port: start the measurement again",
            )
        return []

    def _accepted(self, lines: list[tuple[int, Held]]) -> list[Placed[Held]]:
        placed = []
        for counter, sample in lines:
            placed.append(Placed(sample, self._step(self._last or 0, counter) - 1))
            self._last = counter
        self._held = []
        return placed

    def left(self) -> list[Placed[Held]]:
        """Return the held samples as rejected, at the end of reading."""
        held, self._held = self._held, []
        return [Placed(sample, None, self._why(counter)) for counter, sample in held]

    def _why(self, counter: int) -> str:
        if counter == self._last:
            return f"the sample counter {counter} a second time"
        return f"the sample counter {counter} after {self._last} is out of order"

    def _step(self, before: int, after: int) -> int:
        return (after - before) % (self._modulus or 1)

    def _ahead(self, before: int, after: int) -> bool:
        return 0 < self._step(before, after) <= (self._modulus or 1) // 2
