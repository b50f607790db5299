"""Clocks of virtual time, which is faster than real time."""

from __future__ import annotations

import math
import threading
import time

from dbbstation.errors import MachineError

STAND_S = 0.2
"""Real time that the bar waits outside the circle before each run [s]: on a fast clock the program may miss the path's
own dwell."""

_STAND_WAITING_S = 5.0
"""The same for a machine that waits, in machine time [s]: several samples of a slow instrument, which no program can
miss."""

_BEHIND_S = 3.0
"""Machine time after a run [s], so that samples follow the run's end."""

_LONGEST_PACE_S = 0.01
"""Longest step of paced time [s of real time]: twice the instrument's usual pause, so that only a busy computer is waited
for."""

_STEP_S = 0.5
"""Machine time that passes in one step [s]: some samples, so that the line carries several frames together."""

_PATIENCE_S = 25.0
"""Longest real time of reading a run [s]; a control client waits a little longer."""


class ScaledClock:
    """A clock that starts at 0, `scale` times as fast as real time.

    Args:
        scale: above 0.

    Raises:
        ValueError: the scale is not above 0.
    """

    def __init__(self, scale: float = 1.0) -> None:
        if not scale > 0.0:
            raise ValueError(f"a time scale is above 0, not {scale}")
        self.scale = scale
        self._start_s = time.monotonic()

    def __call__(self) -> float:
        """Return the scaled time since the start [s]."""
        return (time.monotonic() - self._start_s) * self.scale

    def real_s(self, virtual_s: float) -> float:
        """Return the real duration of virtual seconds."""
        return virtual_s / self.scale

    def stand_s(self) -> float:
        """Return the bar's waiting time before a run [s]."""
        return STAND_S * self.scale

    def advance(self, *, asked: bool) -> None:
        """Do nothing: this clock runs by itself."""
        del asked

    def exchanges(self, period_s: float) -> bool:
        """Return True: this clock runs by itself."""
        del period_s
        return True

    def line_s(self) -> float:
        """Return the time up to which reply bytes have passed the line [s]."""
        return self()

    def run_until(self, t_s: float) -> None:
        """Do nothing: this clock runs by itself."""

    def settle(self) -> None:
        """Do nothing: this clock never stops."""


class PacedClock(ScaledClock):
    """Machine time that stands still while its computer is busy elsewhere; the instrument advances it."""

    def __init__(self, scale: float = 1.0) -> None:
        super().__init__(scale)
        self._now_s, self._seen_s = 0.0, time.monotonic()

    def __call__(self) -> float:
        """Return the machine time [s]."""
        return self._now_s

    def advance(self, *, asked: bool) -> None:
        """Advance by the real time since the last call, if that is short."""
        del asked
        seen_s, self._seen_s = self._seen_s, time.monotonic()
        self._now_s += self.scale * min(self._seen_s - seen_s, _LONGEST_PACE_S)


class WaitingClock(ScaledClock):
    """Machine time that passes only during runs, as fast as samples are read or requested."""

    def __init__(self) -> None:
        super().__init__()
        self._now_s = self._until_s = 0.0
        self._stands = threading.Condition()

    def __call__(self) -> float:
        """Return the machine time [s]."""
        return self._now_s

    def real_s(self, virtual_s: float) -> float:
        """Return 0 during a run, else the virtual duration [s]."""
        return virtual_s if self._now_s >= self._until_s else 0.0

    def stand_s(self) -> float:
        """Return the bar's waiting time before a run [s]."""
        return _STAND_WAITING_S

    def advance(self, *, asked: bool) -> None:
        """Advance a little, up to the run's end, unless requests do."""
        if asked:
            return
        with self._stands:
            self._now_s = min(self._now_s + _STEP_S, self._until_s)
            if self._now_s >= self._until_s:
                self._stands.notify_all()

    def exchanges(self, period_s: float) -> bool:
        """Return whether a reading is possible now, and then advance by one period for its exchange."""
        with self._stands:
            if self._now_s >= self._until_s:
                return False
            self._now_s += period_s
            if self._now_s >= self._until_s:
                self._stands.notify_all()
            return True

    def line_s(self) -> float:
        """Return infinity: a reply arrives at once."""
        return math.inf

    def run_until(self, t_s: float) -> None:
        """Advance to a time after a run's end [s]."""
        with self._stands:
            self._until_s = t_s + _BEHIND_S

    def settle(self) -> None:
        """Wait until the run is over.

        Raises:
            MachineError: nobody reads the run's samples.
        """
        with self._stands:
            if not self._stands.wait_for(lambda: self._now_s >= self._until_s, _PATIENCE_S):
                raise MachineError(
                    "its time has stopped during a run, since its samples are not read",
                    where="virtual machine",
                    remedy="read the instrument's port, or close it",
                )
