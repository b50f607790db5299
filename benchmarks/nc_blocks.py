"""Blocks of an NC program per second of the processor, and memory: read, compensated and written.

    python -m benchmarks.nc_blocks 50000

A surface in lines of 0.5 mm, on the reference machine with drawn errors. Commits that have no `LongText` need the joined lines.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.registry import dialect_named
from dbbstation.nc.spilled import LongText
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources

if TYPE_CHECKING:
    from collections.abc import Iterator

SEED = 24


def program(blocks: int) -> Iterator[bytes]:
    """Yield the lines of a program of so many blocks."""
    yield b"G21 G90 G94 G17\nG0 X0 Y0 Z-990 A0 B0 C0\nF2000\nG1 Z-1000\n"
    for block in range(blocks):
        row, way = divmod(0.5 * block, 100.0)
        x, y = (way - 50.0) * (-1.0) ** row, 0.1 * (row % 1000) - 50.0
        z = 3.0 * math.sin(x / 10.0) * math.cos(y / 10.0) - 1000.0
        yield f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f}\n".encode()
    yield b"M2\n"


def main(blocks: int) -> None:
    """Print blocks per second, and memory before and at most."""
    drawn, sources = np.random.default_rng(SEED), known_sources()
    machine = replace(read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml"), acceleration_mm_s2=5e4)
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.1, 6))
    model = MachineModel(machine, (struts, Fitted(sources["base-joints"], drawn.normal(0.0, 0.2, 18))))
    linuxcnc = dialect_named("linuxcnc")

    def done(text: LongText) -> None:
        compensated_program(linuxcnc.toolpath(text, "surface.ngc"), linuxcnc, Inverse(model))

    done(LongText(program(200)))  # compiles
    text = LongText(program(blocks))
    before_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    begin = time.process_time()
    done(text)
    took = time.process_time() - begin
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(f"{blocks / took:.0f} blocks/s, {most_mb} MB, {before_mb} before")


if __name__ == "__main__":
    main(int(sys.argv[1]))
