"""A virtual machine on a pseudo-terminal in this process, and `measure` against it in another."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.instrument.library import at_rate, load_instrument
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.cell import VirtualCell
from dbbstation.virtual.control import CellCommands, ControlServer
from dbbstation.virtual.machine import Sizes, VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from dbbstation.virtual.wire_clock import ScaledClock
from tests.copied import done
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from dbbstation.virtual.control import Programs

SHORT_PLAN = """\
format: dbb-plan/1
name: short
path: {radius_mm: 150.0, feed_mm_min: 1000, start_deg: 0, overshoot_deg: 45, feed_in_mm: 1.5, directions: [ccw, cw]}
jig:
  bores: {4: [-100, -100], 9: [0, 0]}
  origin_in_machine_mm: [0, 0, -1150]
holders:
  short: {repeatability_um: 0.58}
balls:
  9-short: {bore: 9, holder: short, centre_mm: [0.0, 0.0, 0.0], uncertainty_um: 0.8}
  4-short: {bore: 4, holder: short, centre_mm: [-100.0, -100.0, 0.0], uncertainty_um: 0.8}
tests:
  - {name: a, ball: 9-short}
  - {name: b, ball: 4-short, a_deg: 10, b_deg: -10, elevation_deg: 5}
repeat_at_end: [a]
"""

STREAM, POLLED = "streaming-encoder", "heidenhain-nd281b"
MACHINE_FILE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PATIENCE_S = 120.0
"""Real seconds after which a test that waits for another process has failed; busy computers need some."""


@dataclass(frozen=True)
class Bench:
    """What a test sees of it."""

    plan_file: Path
    instrument: str
    scale: float
    rate_hz: float | None
    wire: VirtualInstrument
    cell: VirtualCell
    url: str

    def command(self, out: Path, *more: str, auto: bool = True) -> list[str]:
        words = ["measure", "--plan", str(self.plan_file)]
        words += ["--machine", str(MACHINE_FILE), "--instrument", self.instrument, "--port", self.wire.port]
        words += ["--out", str(out), "--time-scale", str(self.scale)]
        words += [] if auto else ["--bar-waiver", "a virtual machine"]
        words += [] if self.rate_hz is None else ["--rate-hz", str(self.rate_hz)]
        return [*words, *(["--auto", self.url] if auto else []), *more]

    def measure(self, out: Path, *more: str, auto: bool = True, typed: str = "") -> subprocess.CompletedProcess[str]:
        return done(self.command(out, *more, auto=auto), typed=typed, timeout=PATIENCE_S)


@contextmanager
def bench(
    plan_file: Path,
    *,
    instrument: str = STREAM,
    scale: float = 60.0,
    rate_hz: float | None = 40.0,
    seed: int = 3,
    sizes: Sizes | None = None,
    programs: Programs | None = None,
) -> Iterator[Bench]:
    machine, plan = read_machine(MACHINE_FILE), read_plan(plan_file)
    virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, seed)), plan, seed=seed, sizes=sizes)
    virtual.check()
    clock = ScaledClock(scale)
    cell = VirtualCell(virtual, clock)
    protocol = at_rate(load_instrument(instrument), rate_hz)
    with (
        VirtualInstrument(protocol, cell.length_mm_at, clock=clock) as wire,
        ControlServer(CellCommands(cell, programs)) as control,
    ):
        yield Bench(plan_file, instrument, scale, rate_hz, wire, cell, control.url)


def wait_for(what: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    """Wait until something is true, as long as the process that brings it about lives."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < deadline_s, "it did not come"
        assert process is None or process.poll() is None, "the process ended before"
        time.sleep(0.01)


def lines_of(part: Path) -> int:
    return max(part.read_bytes().count(b"\n") - 4, 0) if part.exists() else 0
