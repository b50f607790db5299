"""The virtual cell: machine, ball and bar in virtual time."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.errors import MachineError
from dbbstation.virtual.wire_clock import WaitingClock

if TYPE_CHECKING:
    from dbbstation.plan.plan import Direction
    from dbbstation.virtual.machine import CommandedPath, VirtualMachine, VirtualRun
    from dbbstation.virtual.wire_clock import ScaledClock


class VirtualCell:
    """The bar's reading at any virtual time."""

    def __init__(self, machine: VirtualMachine, clock: ScaledClock) -> None:
        self.machine = machine
        self._clock = clock
        self._lock = threading.Lock()
        self._running: VirtualRun | None = None
        self._block_mm: float | None = None
        self._origin_s: float | None = None

    def length_mm_at(self, t_s: float) -> float | None:
        """Return the reading at a virtual time [mm]; None while the bar is off the balls."""
        with self._lock:
            running, block_mm = self._running, self._block_mm
        if block_mm is not None:
            return block_mm + self.machine.bar_error_mm + self.machine.noise_mm()
        if running is None:
            return None
        return running.length_mm_at(t_s - running.begin_s) + self.machine.noise_mm()

    def mount(self, test: str) -> int:
        """Mount a test's ball again and return the mounting's number.

        Raises:
            MachineError: a run goes on, or an unknown test.
        """
        self._refuse_while_running("put up a ball")
        if test not in self.machine.plan.tests:
            names = ", ".join(self.machine.plan.tests)
            raise MachineError(f"the plan has no test {test}", where="virtual machine", remedy=f"its tests: {names}")
        with self._lock:
            self._running = self._block_mm = None
            return self.machine.mount(self.machine.plan.tests[test].ball)

    def calibrate(self, length_mm: float) -> None:
        """Put the bar on a calibrator until a ball is mounted or a run starts.

        Raises:
            MachineError: a run goes on.
        """
        self._refuse_while_running("put the bar on its calibrator")
        with self._lock:
            self._running, self._block_mm = None, length_mm
        self._clock.run_until(math.inf)

    def start(self, test: str, direction: Direction, path: CommandedPath | None = None) -> VirtualRun:
        """Start a run, after replacing another test's ball.

        Raises:
            MachineError: another run goes on, or this one is impossible.
        """
        self._refuse_while_running("start another run")
        if self._origin_s is None:
            self._origin_s = self._clock()
        # Computing and standing take some real time, which on a fast clock is a while; slow errors do not mind.
        run = self.machine.run(test, direction, path=path, begin_s=self._clock() - self._origin_s)
        with self._lock:
            self._block_mm = None
            self.machine.restart_noise()
            self._running = run = replace(run, begin_s=self._clock() + self._clock.stand_s())
        self._clock.run_until(run.end_s)
        return run

    def stop(self) -> None:
        """Stop the machine and lay the bar aside."""
        self._clock.settle()
        with self._lock:
            self._running = self._block_mm = None

    @property
    def running(self) -> bool:
        """Return whether the machine moves."""
        with self._lock:
            return self._running is not None and self._clock() < self._running.end_s

    def status(self) -> dict[str, object]:
        """Return the state as plain values."""
        self._clock.settle()
        with self._lock:
            running = self._running
        ball = self.machine.mounted
        told: dict[str, object] = {
            "state": "running" if self.running else "idle",
            "ball": None if ball is None else ball.name,
            "mounting": self.machine.mountings or None,
        }
        if isinstance(self._clock, WaitingClock):
            told["stands_since_s"] = self._clock()
        if running is not None:
            elapsed_s = min(max(self._clock() - running.begin_s, 0.0), running.path.duration_s)
            told |= {
                "test": running.test,
                "direction": running.direction.value,
                "elapsed_s": round(elapsed_s, 3),
                "duration_s": round(running.path.duration_s, 3),
            }
        return told

    def _refuse_while_running(self, what: str) -> None:
        self._clock.settle()
        if self.running:
            raise MachineError(f"cannot {what} during a run", where="virtual machine", remedy="wait, or stop it")
