"""Virtual time: real time, faster, so that a circle of a minute need not take a minute."""

from __future__ import annotations

import time


class ScaledClock:
    """A clock that runs `scale` times as fast as real time and starts at 0.

    Args:
        scale: virtual seconds per real second, above 0.

    Raises:
        ValueError: the scale is not above 0.
    """

    def __init__(self, scale: float = 1.0) -> None:
        if not scale > 0.0:
            raise ValueError(f"a time scale is above 0, not {scale}")
        self.scale = scale
        self._start_s = time.monotonic()

    def __call__(self) -> float:
        """Return the virtual time in s; monotonic."""
        return (time.monotonic() - self._start_s) * self.scale

    def real_s(self, virtual_s: float) -> float:
        """Return how many real seconds these virtual seconds last."""
        return virtual_s / self.scale
