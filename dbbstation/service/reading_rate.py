"""Readings per second."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.station.events import Sample

_WINDOW_S = 2.0
"""Time over which readings are counted [s]: enough for a few readings per second, and short enough to follow a
change."""

_FEWEST = 3


class ReadingRate:
    """Counts samples over the last seconds of their own time."""

    def __init__(self) -> None:
        self._batches: deque[tuple[float, int]] = deque()
        self.total = 0

    def add(self, samples: Sequence[Sample]) -> None:
        """Count samples in time order; a changed clock resets the count."""
        last_s = samples[-1].t_s
        if self._batches and not 0.0 <= samples[0].t_s - self._batches[-1][0] <= _WINDOW_S:
            self._batches.clear()
        self._batches.append((last_s, len(samples)))
        self.total += len(samples)
        while len(self._batches) > _FEWEST and self._batches[0][0] < last_s - _WINDOW_S:
            self._batches.popleft()

    def forget(self) -> None:
        """Reset for another line."""
        self._batches.clear()

    @property
    def per_s(self) -> float | None:
        """Return readings per second; None for too few."""
        if len(self._batches) < _FEWEST:
            return None
        span_s = self._batches[-1][0] - self._batches[0][0]
        return (sum(count for _, count in self._batches) - self._batches[0][1]) / span_s if span_s > 0.0 else None
