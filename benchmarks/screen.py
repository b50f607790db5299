"""What the station's screens cost while a circle comes at 1 kHz, against the same sequence without a screen.

Each screen runs on a pseudo-terminal in a process of its own, ten looks a second, as `dbbstation measure` runs it: sequencer,
runner, board, app and Textual's driver are the real ones. Readings come from memory as time passes, so that no instrument and
no virtual machine is among what is measured. The share of a core is the processor time of that process over twelve seconds in
the middle of the circle. A look is taking the mail and drawing the board into widgets; what Textual makes of them later is in
the share. The peer is the same process without the app.

    python benchmarks/screen.py
    python benchmarks/screen.py --json
"""

from __future__ import annotations

import fcntl
import json
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show  # isort: skip - sets up the environment

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.instrument.reading import Reading
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.service.board import Board, SequenceOpened
from dbbstation.service.runner import Runner
from dbbstation.station.commands import Start
from dbbstation.station.engine import Station
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from dbbstation.tui.board_screen import Shown
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

RATE_HZ = 1000.0
SETTLED_S, SECONDS = 4.0, 12.0
"""After the feed-in, before the measurement begins; and how long it takes [s]."""

SIZES = [(80, 24), (120, 40), (200, 60)]
SCREENS = ["measure", "large", "overview"]
NONE = "none"
PATIENCE_S = 120.0
SEED = 5


class Memory:
    """A started instrument whose readings have been made before, and come as time passes."""

    def __init__(self, lengths_mm: Sequence[float]) -> None:
        self._lengths_mm = lengths_mm
        self._began_s = time.monotonic()
        self.given = 0

    def drain(self) -> list[Reading]:
        """Return what has come since the last call."""
        due = min(int((time.monotonic() - self._began_s) * RATE_HZ), len(self._lengths_mm))
        came = [Reading(k / RATE_HZ, self._lengths_mm[k]) for k in range(self.given, due)]
        self.given = due
        return came


class Measured:
    """Looks of one process, and its processor time over the measured seconds."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._turning_s: float | None = None
        self._cpu_s = self._from_s = self._rate = 0.0
        self.looks_s: list[float] = []
        self.result: dict[str, float] | None = None

    def look(self, work: object) -> None:
        """Time one look; note the result when the seconds are over."""
        began_s = time.perf_counter()
        if callable(work):
            work()
        now_s = time.perf_counter()
        if self._board.state is State.TURNING and self._turning_s is None:
            self._turning_s = now_s
        if self._turning_s is None or self.result is not None or now_s < self._turning_s + SETTLED_S:
            return
        if not self._from_s:
            self._from_s, self._cpu_s, self._rate = now_s, time.process_time(), self._board.rate.total
            return
        self.looks_s.append(now_s - began_s)
        if now_s > self._from_s + SECONDS:
            wall_s = now_s - self._from_s
            self.result = {
                "share": (time.process_time() - self._cpu_s) / wall_s,
                "look_ms": 1e3 * float(np.median(self.looks_s)),
                "slowest_ms": 1e3 * max(self.looks_s),
                "per_s": (self._board.rate.total - self._rate) / wall_s,
                "looks_per_s": len(self.looks_s) / wall_s,
                "lost": self._board.lost,
            }


def one(screen: str, result: str) -> None:
    """Be one process: run a circle on a screen, write what was measured."""
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    inline = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    plan = inline.to_domain()
    virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, SEED)), plan, seed=SEED)
    run = virtual.run("low", Direction.CCW)
    times_s = np.arange(0.0, SETTLED_S + SECONDS + 10.0, 1.0 / RATE_HZ)
    lengths_mm = [run.length_mm_at(float(t_s)) + virtual.noise_mm() for t_s in times_s]

    @contextmanager
    def opened() -> Iterator[tuple[Station, SequenceOpened]]:
        schedule = Schedule(plan, lambda _test, _direction: 1)
        station = Station(Sequencer(plan, schedule, recording_of), Memory(lengths_mm))
        station.send(Start())
        yield station, SequenceOpened(schedule.tasks, schedule.open, "memory")

    runner = Runner(opened)
    measured = on_screen(screen, runner, Shown(plan.name, inline.plate.bores, tests=plan.tests))
    with open(result, "w", encoding="utf-8") as file:  # noqa: PTH123
        json.dump(measured.result, file)


def on_screen(screen: str, runner: Runner, shown: Shown) -> Measured:
    """Run until everything is measured."""
    if screen == NONE:
        board = Board()
        measured = Measured(board)

        def take() -> None:
            for event in runner.mail():
                board.take(event)

        runner.start()
        while measured.result is None:
            measured.look(take)
            time.sleep(0.1)
        runner.close()
        return measured
    app = Benchmarked(shown, runner, screen)
    app.run()
    return app.measured


class Benchmarked(StationApp):
    """The app; goes to its screen when the circle has begun, ends when everything is measured."""

    def __init__(self, shown: Shown, runner: Runner, screen: str) -> None:
        super().__init__(shown, runner)
        self.measured = Measured(self.board)
        self._to = screen

    def look(self) -> None:
        """Look, with the clock running."""
        self.measured.look(super().look)
        if self.board.state is State.TURNING and self._to != "measure":
            self.call_later(self.run_action, self._to)
            self._to = "measure"
        if self.measured.result is not None:
            self.exit()


def in_a_process(screen: str, size: tuple[int, int]) -> dict[str, float]:
    """Run one screen on a pseudo-terminal of its own and return what it measured."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
    read_end, write_end = os.pipe()
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": str(size[0]), "LINES": str(size[1])}
    words = [sys.executable, __file__, "--be", screen, f"/dev/fd/{write_end}"]
    with subprocess.Popen(  # noqa: S603 (words of our own)
        words, stdin=slave, stdout=slave, stderr=slave, env=environment, pass_fds=[write_end], start_new_session=True
    ) as process:
        os.close(slave)
        os.close(write_end)
        end_s, shown = time.monotonic() + PATIENCE_S, b""
        while process.poll() is None and time.monotonic() < end_s:
            if select.select([master], [], [], 0.1)[0]:
                shown = _read(master) or shown
        if process.poll() is None:
            process.kill()
    os.close(master)
    with os.fdopen(read_end, encoding="utf-8") as file:
        written = file.read()
    if not written:
        raise RuntimeError(f"{screen} at {size} measured nothing: {shown[-400:]!r}")
    found: dict[str, float] = json.loads(written)
    return found


def _read(master: int) -> bytes:
    try:
        return os.read(master, 65536)
    except OSError:
        return b""  # the other end is closed


def rows(screen: str, size: tuple[int, int]) -> list[Row]:
    """Measure one screen at one size."""
    found = in_a_process(screen, size)
    title = "without a screen" if screen == NONE else f"{screen} {size[0]}x{size[1]}"
    came = f"{found['per_s']:.0f} readings/s, {found['lost']:.0f} lost"
    looks = f"slowest {found['slowest_ms']:.1f} ms, {found['looks_per_s']:.1f} looks/s"
    return [
        Row(title, 100.0 * found["share"], "% of core", came),
        Row(f"{title}: a look", found["look_ms"], "ms", looks),
    ]


if __name__ == "__main__":
    if "--be" in sys.argv:
        one(*sys.argv[-2:])
    else:
        table = rows(NONE, SIZES[0])
        for screen in SCREENS:
            for size in SIZES:
                table += rows(screen, size)
        show(f"The station's screens at {RATE_HZ:.0f} readings per second", table, f"{SECONDS:.0f} s each")
