"""Capture keeps up: the full rate of a line of 921,600 baud over a pseudo-terminal, into the journal of a session.

`pytest -m nightly tests/station/test_sustained.py -s` does it for ten minutes and prints what it took.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.recordings import journal
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.instrument.driver import Instrument, Tally
from dbbstation.instrument.library import load_instrument
from dbbstation.station import events
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Quit, Start
from dbbstation.station.detector import Patience
from tests.station.bench import MACHINE_FILE

BAUD = 921_600
SENDER = Path(__file__).with_name("line_sender.py")
PROMISED_S = 1.0
"""On the disk, from the moment that a reading was taken."""

MEMORY_BYTES = 8_000_000
"""What a process may grow by from its first tenth on; a second of samples in lists has 0.4 MB, ten minutes 200 MB."""


TRIES = 3
"""Where other tests keep all cores busy, the line may be left alone for longer than its buffer holds, 44 ms: that is no fault of the
capture. One that cannot keep up fails at each try."""

AHEAD = -10
"""Nice value of the capture, where the rights are there: at a machine nothing else runs beside it."""


@contextmanager
def ahead_of_others() -> Iterator[None]:
    """Let this thread, and threads and processes that it begins, run before those of other tests."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, AHEAD)
    except PermissionError:
        yield
        return
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)


class Watched:
    """An instrument whose readings are followed until they are on the disk."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self._batch_s: float | None = None
        self._waiting_s: float | None = None
        self.behind_s = 0.0
        self.count = 0

    def drain(self):
        readings = self._instrument.drain()
        if readings:
            self.count += len(readings)
            self._batch_s = readings[0].t_s
            if self._waiting_s is None:
                self._waiting_s = self._batch_s
        return readings

    def synced(self) -> None:
        if self._waiting_s is not None:
            self.behind_s = max(self.behind_s, time.monotonic() - self._waiting_s)
        self._waiting_s = self._batch_s


def resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


@dataclass
class Captured:
    """What came of a capture.

    Attributes:
        sent: what the sender says of the line.
        behind_s: longest time from a reading to the disk [s].
        lost: samples lost, as the sequence was told.
        memory: bytes in use, every half second.
    """

    sent: dict[str, float]
    tally: Tally
    behind_s: float
    lost: int
    memory: list[int]
    cpu: float


def capture(job: Job, port: str, line: int, seconds: float, monkeypatch: pytest.MonkeyPatch) -> Captured:
    lost, memory = [0], list[int]()
    with Instrument(load_instrument("streaming-encoder", "no-checksum"), port, baud=BAUD, timeout_s=5.0) as instrument:
        source = Watched(instrument)
        fsync = os.fsync

        def told_fsync(handle: int) -> None:
            fsync(handle)
            source.synced()

        monkeypatch.setattr(journal.os, "fsync", told_fsync)
        workplace = assemble(job, source)
        station = workplace.station

        def answer(event: events.Event) -> None:
            if isinstance(event, events.RunAnnounced):
                station.send(Start())
            elif isinstance(event, events.SamplesRecorded):
                lost[0] += sum(sample.lost for sample in event.samples)

        station.subscribe(answer)
        words = [sys.executable, str(SENDER), str(line), str(BAUD), str(seconds)]
        with subprocess.Popen(words, pass_fds=[line], stdout=subprocess.PIPE) as sender:

            def watch() -> None:
                while sender.poll() is None:
                    memory.append(resident_bytes())
                    time.sleep(0.5)
                time.sleep(0.5)  # for what is still under way
                station.send(Quit())

            watcher = threading.Thread(target=watch)
            begun_s, cpu_s = time.monotonic(), time.process_time()
            watcher.start()
            station.run()
            cpu = (time.process_time() - cpu_s) / (time.monotonic() - begun_s)
            watcher.join()
            sent = json.loads(sender.stdout.read())
        workplace.close()
        return Captured(sent, instrument.tally, source.behind_s, lost[0], memory, cpu)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory and pseudo-terminals of Linux")
@pytest.mark.parametrize(
    "seconds", [pytest.param(5.0, marks=pytest.mark.slow), pytest.param(600.0, marks=pytest.mark.nightly)]
)
def test_a_line_at_its_full_rate_loses_nothing(plan_file: Path, tmp_path: Path, monkeypatch, seconds: float) -> None:
    machine, plan = read_machine(MACHINE_FILE), read_inline_plan(plan_file)
    for number in range(TRIES):
        folder = tmp_path / f"session-{number}"
        line, port = os.openpty()
        tty.setraw(port)
        with ahead_of_others():
            job = Job(machine, plan, folder, patience=Patience(turn_factor=1e6))
            found = capture(job, os.ttyname(port), line, seconds, monkeypatch)
        os.close(line)
        os.close(port)
        if found.sent["dropped_bytes"] == 0 and found.behind_s < PROMISED_S:
            break
    (part,) = (folder / "runs").glob("*.part")
    rows = part.read_bytes().count(b"\n") - 4
    grown = found.memory[-1] - found.memory[len(found.memory) // 10]
    sent, tally = found.sent, found.tally
    sys.stdout.write(
        f"\n{seconds:g} s at {BAUD} baud: {sent['frames']} frames sent, {tally.readings} read, {rows} in the journal, "
        f"{tally.lost} lost, {sent['dropped_bytes']} bytes dropped by the line, {tally.garbage_bytes} not understood; "
        f"{tally.readings / sent['seconds']:.0f} readings/s; CPU {100 * found.cpu:.0f} % of one core; "
        f"disk at most {found.behind_s:.2f} s behind; memory grew by {grown / 1e6:.1f} MB; "
        f"the sender was late by {sent['latest_s']:.3f} s at most\n"
    )
    assert sent["dropped_bytes"] == 0
    # Who joins a stream cannot know that the first frame is whole.
    assert (tally.readings, tally.lost, tally.garbage_bytes) == (sent["frames"] - 1, 0, 0)
    assert found.lost == 0
    # The run begins with the third reading that agrees.
    assert rows == tally.readings - 2
    assert found.behind_s < PROMISED_S
    assert grown < MEMORY_BYTES
    if seconds < 60.0:
        assert len(read_run(part).recording) == rows
