"""When a sample was taken, from when its bytes were seen.

The host sees bytes late, never early: the line takes time, adapters collect bytes (16 ms on a common USB chip), and the
system wakes the reader when it likes. For a request the moment is known from the sending side. For a stream, the sample
number times the period is a clock with a tiny jitter but an unknown offset; the offset is the smallest delay seen lately,
because a delay only ever adds.
"""

from __future__ import annotations

from collections import deque


class MachineTime:
    """Clock of a virtual machine that waits until every sample is read: samples are counted, and no arrival is timed.

    As a clock it gives the time of the last sample.
    """

    def __init__(self, period_s: float, begins_s: float) -> None:
        self._period_s = period_s
        self._begins_s = begins_s
        self._number = 0

    def stamp(self, _seen_s: float, lost: int = 0) -> float:
        """Return the time of the next sample, in s, at most a period early: where in its period it lies is unknown."""
        self._number += 1 + lost
        return self()

    def __call__(self) -> float:
        """Return the time of the last sample [s]."""
        return self._begins_s + max(self._number - 1, 0) * self._period_s


class StreamStamps:
    """Sample times of a stream that is paced by the device.

    Args:
        memory_s: how long a small delay is remembered. A device whose clock is off by 100 ppm drifts 0.2 ms in 2 s.
    """

    def __init__(self, period_s: float, memory_s: float = 2.0) -> None:
        self._period_s = period_s
        self._memory = max(2, round(memory_s / period_s))
        self._number = 0
        self._offsets: deque[tuple[int, float]] = deque()
        self._last_s = float("-inf")

    def stamp(self, seen_s: float, lost: int = 0) -> float:
        """Return the time of the next sample, in s, strictly later than the one before.

        Args:
            seen_s: when its last byte can have left the device at the latest.
        """
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
