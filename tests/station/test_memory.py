"""The memory of a run that is recorded does not grow with its length: samples are on the disk, not in lists."""

from __future__ import annotations

import gc
import tracemalloc
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.instrument.reading import Reading
from dbbstation.service.board import Board
from dbbstation.station import events
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Quit, Start
from dbbstation.station.detector import Patience
from dbbstation.station.states import State
from tests.station.bench import MACHINE_FILE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.station.engine import Station

RATE_HZ = 4000.0
BATCH = 400
"""What comes between two looks at the instrument, a tenth of a second."""

BOUND_BYTES = 2_000_000
"""What may stay are some batches, the points of a screen and caches. Lists of times, lengths and flags have 80 bytes a sample."""


class LongRun:
    """A bar that feeds in and then turns for as long as is asked; it quits in the middle of the turn."""

    def __init__(self, count: int) -> None:
        self.count, self.sent, self.armed = count, 0, False
        self.station: Station | None = None
        self.at_bytes: dict[int, int] = {}

    def drain(self) -> Sequence[Reading]:
        if not self.armed:
            return []
        first = self.sent
        self.sent += BATCH
        if first >= self.count:
            self.station.send(Quit())
        if first in {self.count // 10, self.count - BATCH}:
            gc.collect()
            self.at_bytes[first] = tracemalloc.get_traced_memory()[0]
        numbers = np.arange(first, first + BATCH)
        lengths = np.where(numbers < RATE_HZ, 151.5, 150.0 + 0.01 * np.sin(numbers / 5000.0))
        return [Reading(n / RATE_HZ, mm) for n, mm in zip(numbers.tolist(), lengths.tolist(), strict=True)]

    def __call__(self, event: events.Event) -> None:
        if isinstance(event, events.StateChanged):
            self.armed = event.state not in {State.BETWEEN, State.ANNOUNCED}
        elif isinstance(event, events.RunAnnounced):
            self.station.send(Start())


def growth_bytes(plan_file: Path, folder: Path, count: int) -> int:
    """Memory that the last nine tenths of a run add, station, storage and what a screen keeps together [bytes]."""
    source = LongRun(count)
    job = Job(read_machine(MACHINE_FILE), read_inline_plan(plan_file), folder, patience=Patience(turn_factor=1e6))
    workplace = assemble(job, source)
    source.station = workplace.station
    workplace.station.subscribe(source)
    workplace.station.subscribe(Board().take)
    tracemalloc.start()
    try:
        workplace.station.run()
    finally:
        tracemalloc.stop()
        workplace.close()
    (part,) = (folder / "runs").glob("*.part")
    assert part.read_bytes().count(b"\n") > count
    early, late = source.at_bytes.values()
    return late - early


def test_memory_is_flat(plan_file: Path, tmp_path: Path) -> None:
    """Ten seconds at 4 kHz, which was nearly 3 MB when a run kept its samples."""
    assert growth_bytes(plan_file, tmp_path / "session", 40_000) < BOUND_BYTES


@pytest.mark.nightly
def test_memory_is_flat_over_millions_of_samples(plan_file: Path, tmp_path: Path) -> None:
    assert growth_bytes(plan_file, tmp_path / "session", 3_000_000) < BOUND_BYTES
