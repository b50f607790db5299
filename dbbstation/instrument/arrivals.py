"""When each byte of a line can have arrived at the latest."""

from __future__ import annotations

from collections import deque


class Arrivals:
    """Remembers when bytes were seen, as far back as a frame reaches.

    Bytes that are seen together arrived one after the other: those in front earlier by the time that the others take.

    Args:
        reach: bytes that a question may lie behind the newest.
    """

    def __init__(self, character_s: float, reach: int) -> None:
        self._character_s = character_s
        self._reach = reach
        self._count = 0
        self._chunks: deque[tuple[int, float]] = deque()

    def note(self, size: int, seen_s: float) -> None:
        """Take note of bytes that were seen together."""
        if size <= 0:
            return
        self._count += size
        self._chunks.append((self._count, seen_s))
        while len(self._chunks) > 1 and self._chunks[0][0] < self._count - self._reach:
            self._chunks.popleft()

    def at_latest_s(self, behind: int) -> float:
        """Return when the byte with so many behind it had arrived at the latest [s]."""
        place = self._count - behind
        end, seen_s = next(one for one in self._chunks if one[0] >= place)
        return seen_s - (end - place) * self._character_s
