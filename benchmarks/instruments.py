"""How many readings per second the driver takes from a stream, and what it costs.

The virtual instrument runs in a process of its own, at the speed of its line; the driver in this one. Each stream is read for
ten seconds. The share of a core is the processor time of this process over the time that passed: reading, decoding with the
checksum, judging the counter, stamping, queueing and draining every 10 ms.

    python benchmarks/instruments.py
    python benchmarks/instruments.py --json
"""

from __future__ import annotations

import subprocess
import sys
import time

from benchmarks.measuring import Row, show  # isort: skip - sets up the environment

from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import at_rate, load_instrument
from dbbstation.virtual.wire import VirtualInstrument

SECONDS = 10.0
STREAMS = [
    ("streaming-encoder", 250.0, 115_200),
    ("streaming-encoder", 3500.0, 921_600),
    ("streaming-encoder-binary", 4000.0, 921_600),
    ("streaming-encoder-binary", 7680.0, 921_600),
]


def stand_in(name: str, rate_hz: float, baud: int) -> None:
    """Be the instrument until standard input ends."""
    with VirtualInstrument(load_instrument(name), lambda _: 150.0, rate_hz=rate_hz, baud=baud) as wire:
        print(wire.port, flush=True)
        sys.stdin.read()


def read(name: str, rate_hz: float, baud: int) -> list[Row]:
    """Read a stream and return what came, what was lost and what it cost."""
    words = [sys.executable, __file__, "--be", name, str(rate_hz), str(baud)]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True) as other:  # noqa: S603 (words of our own)
        if other.stdout is None:
            raise RuntimeError("the stand-in has no output")
        port = other.stdout.readline().strip()
        with Instrument(at_rate(load_instrument(name), rate_hz), port, baud=baud) as driver:
            driver.read()
            began_s, used_s, count = time.monotonic(), time.process_time(), 0
            while time.monotonic() - began_s < SECONDS:
                count += len(driver.drain())
                time.sleep(0.01)
            passed_s = time.monotonic() - began_s
            share = (time.process_time() - used_s) / passed_s
            remark = f"{driver.tally.lost} lost, {sum(driver.tally.rejected.values())} rejected"
        other.communicate()
    what = f"{name}, {baud} baud"
    return [Row(what, count / passed_s, "1/s", remark), Row(f"{what}: core", 100.0 * share, "%", "")]


if __name__ == "__main__":
    if sys.argv[1:2] == ["--be"]:
        stand_in(sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))
    else:
        rows = [row for stream in STREAMS for row in read(*stream)]
        show("Readings of streams", rows, f"driver and virtual instrument on a pseudo-terminal, {SECONDS:g} s each")
