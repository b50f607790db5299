"""Clocks for tests that must not depend on how busy the computer is."""

from __future__ import annotations

from dbbstation.virtual.wire_clock import ScaledClock


class HandClock(ScaledClock):
    """Time that stands still until a test moves it."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


class LeapingClock(HandClock):
    """Time that leaps to what the instrument waits for, and stands still while it waits for a request.

    However late a thread wakes, as much time has passed as the exchange takes on the line, and no more.
    """

    def real_s(self, virtual_s: float) -> float:
        self.now_s += max(virtual_s, 0.0)
        return 0.0
