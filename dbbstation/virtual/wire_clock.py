"""Virtual time: real time, faster, so that a circle of a minute need not take a minute."""

from __future__ import annotations

import threading
import time

from dbbstation.errors import MachineError

STAND_S = 0.2
"""Real time that the bar stands outside before each run: on a fast clock the path's own dwell may pass while the program
at the other end of the line is not looking [s]."""

_STAND_WAITING_S = 5.0
"""The same for a machine that waits: several samples of a slow instrument, and nobody can miss one [s of machine time]."""

_BEHIND_S = 3.0
"""Time that passes after a run, so that its end has samples behind it [s of machine time]."""

_STEP_S = 0.5
"""Time that passes at once: some samples, so that the line is used in pieces that are worth it [s of machine time]."""

_PATIENCE_S = 25.0
"""Real time in which a run is read to its end; a control client waits a little longer [s]."""


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
        """Return the scaled time since the start [s]."""
        return (time.monotonic() - self._start_s) * self.scale

    def real_s(self, virtual_s: float) -> float:
        """Return how many real seconds these virtual seconds last."""
        return virtual_s / self.scale

    def stand_s(self) -> float:
        """Return how long the bar stands outside before a run begins [s of virtual time]."""
        return STAND_S * self.scale

    def advance(self) -> None:
        """Let time pass because samples were read; this clock needs nobody to do that."""

    def run_until(self, t_s: float) -> None:
        """Let time pass up to the end of a run; this clock goes on anyhow."""

    def settle(self) -> None:
        """Wait until time stands; on this clock it never does, and nothing is waited for."""


class WaitingClock(ScaledClock):
    """Machine time that passes during runs only, and only as fast as the samples are read.

    A busy computer delays samples in real time and changes nothing in machine time.
    """

    def __init__(self) -> None:
        super().__init__()
        self._now_s = self._until_s = 0.0
        self._stands = threading.Condition()

    def __call__(self) -> float:
        """Return the time at which the clock stands [s]."""
        return self._now_s

    def real_s(self, virtual_s: float) -> float:
        """Return 0 while time can pass: nothing is waited for."""
        return virtual_s if self._now_s >= self._until_s else 0.0

    def stand_s(self) -> float:
        """Return how long the bar stands outside before a run begins [s]."""
        return _STAND_WAITING_S

    def advance(self) -> None:
        """Let a little time pass, up to the end of the run."""
        with self._stands:
            self._now_s = min(self._now_s + _STEP_S, self._until_s)
            if self._now_s >= self._until_s:
                self._stands.notify_all()

    def run_until(self, t_s: float) -> None:
        """Let time pass up to a time after the end of a run [s]."""
        with self._stands:
            self._until_s = t_s + _BEHIND_S

    def settle(self) -> None:
        """Wait until the run is over and time stands.

        Raises:
            MachineError: nobody reads the samples of the run.
        """
        with self._stands:
            if not self._stands.wait_for(lambda: self._now_s >= self._until_s, _PATIENCE_S):
                raise MachineError(
                    "its time stands still in the middle of a run: nobody reads its samples",
                    where="virtual machine",
                    remedy="read the instrument's port, or close it",
                )
