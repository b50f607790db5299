"""Latest arrival of each byte of a line."""

from __future__ import annotations

from collections import deque


class Arrivals:
    """Remembers when bytes were received, as far back as a frame reaches."""

    def __init__(self, character_s: float, reach: int) -> None:
        self._character_s = character_s
        self._reach = reach
        self._count = 0
        self._chunks: deque[tuple[int, float]] = deque()

    def note(self, size: int, seen_s: float) -> None:
        """Note bytes seen together."""
        if size <= 0:
            return
        self._count += size
        self._chunks.append((self._count, seen_s))
        while len(self._chunks) > 1 and self._chunks[0][0] < self._count - self._reach:
            self._chunks.popleft()

    def at_latest_s(self, behind: int) -> float:
        """Return the latest arrival of the byte with so many behind it [s]."""
        place = self._count - behind
        end, seen_s = next(one for one in self._chunks if one[0] >= place)
        return seen_s - (end - place) * self._character_s
