"""Sample times from the arrival of bytes.

Bytes are received late, never early: line, adapter buffer (16 ms on a common USB chip) and system add delay. A request
bounds the moment of its sample. In a stream, sample number times period is a precise clock. Its offset is the smallest
recent delay.
"""

from __future__ import annotations

from collections import deque


class MachineTime:
    """Clock that counts samples, for a virtual machine that waits for its reader."""

    def __init__(self, period_s: float, begins_s: float) -> None:
        self._period_s = period_s
        self._begins_s = begins_s
        self._number = 0

    def stamp(self, _seen_s: float, lost: int = 0) -> float:
        """Return the time of the next sample [s], at most a period early."""
        self._number += 1 + lost
        return self()

    def __call__(self) -> float:
        """Return the time of the last sample [s]."""
        return self._begins_s + max(self._number - 1, 0) * self._period_s


class StreamStamps:
    """Sample times of a stream.

    Args:
        memory_s: duration of a small delay's validity. A clock off by 100 ppm drifts 0.2 ms in 2 s.
    """

    def __init__(self, period_s: float, memory_s: float = 2.0) -> None:
        self._period_s = period_s
        self._memory = max(2, round(memory_s / period_s))
        self._number = 0
        self._offsets: deque[tuple[int, float]] = deque()
        self._last_s = float("-inf")

    def stamp(self, seen_s: float, lost: int = 0) -> float:
        """Return the time of the next sample [s], strictly rising."""
        self._number += 1 + lost
        offset_s = seen_s - self._number * self._period_s
        # A queue whose offsets rise from left to right: the smallest of the window is always the first.
        while self._offsets and self._offsets[-1][1] >= offset_s:
            self._offsets.pop()
        self._offsets.append((self._number, offset_s))
        while self._offsets[0][0] <= self._number - self._memory:
            self._offsets.popleft()
        t_s = self._offsets[0][1] + self._number * self._period_s
        self._last_s = max(t_s, self._last_s + 1e-6)
        return self._last_s
