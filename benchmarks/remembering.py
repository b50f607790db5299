"""How long programs take to compensate where the machine remembers how it came to a place: play, and spikes at reversals.

    python -m benchmarks.remembering [--json]

Fourteen moves of a tilted part and eleven lines of a zigzag, at a chord error of 0.1 µm, each against the same under a model without a
history. Before sources had a state, rounds over the whole program took 434 s for fourteen moves and 66 s for eleven lines of that size.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.compensate import compensated_parts
from dbbstation.nc.rs274.reader import read_program
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources

if TYPE_CHECKING:
    from dbbstation.nc.toolpath import Toolpath

SEED = 24
GAPS_UM = np.array([3.0, 5.0, 2.0, 4.0, 6.0, 1.0])
SPIKES = np.append(GAPS_UM / 2.0, 2.0)
"""Heights [µm] and the way over which they fade [mm]."""

FOURTEEN = """\
G21 G90 G94
G64 P0.01
G0 X-60 Y-40 Z-1000 A5 B-4 C0
G1 X60 F600
G1 Y40
G1 X40 Y60 A4
G1 X20 Y60
G1 X0 Y40 B-2
G1 X-20 Y60
G1 X-40 Y40 A2
G1 X-60 Y60 A-5 B4
G1 Y-40 Z-1010
G1 X-20
G1 X0 Y-20
G1 X20 Y-40 Z-1000
G1 X40 A0 B0
M2
"""


def zigzag() -> str:
    """Eleven lines, to and fro."""
    lines = [f"G1 X{60 if k % 2 == 0 else -60} Y{-40 + 8 * (k + 1)} F600" for k in range(11)]
    return "\n".join(["G21 G90 G94", "G64 P0.01", "G0 X-60 Y-40 Z-1000 A0 B0 C0", *lines, "M2", ""])


def compensated(path: Toolpath, model: MachineModel) -> None:
    """Compensate all parts of a program."""
    for _ in compensated_parts(path, model):
        pass


def main() -> None:
    """Measure and print."""
    drawn = np.random.default_rng(SEED)
    sources = known_sources()
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.1, 6))
    remembered = {
        "play": Fitted(sources["backlash"], GAPS_UM),
        "spikes": Fitted(sources["reversal-spike"], SPIKES),
    }
    rows = []
    for name, text in (("fourteen moves", FOURTEEN), ("eleven lines", zigzag())):
        path: Toolpath = read_program(text, f"{name}.ngc")
        model = MachineModel(replace(machine, acceleration_mm_s2=50_000.0), (struts,))
        without = timed(partial(compensated, path, model), 5)
        rows.append(Row(f"{name}, no history", without.best_s, "s"))
        for cause, fitted in remembered.items():
            with_it = timed(partial(compensated, path, replace(model, sources=(struts, fitted))), 5)
            rows.append(Row(f"{name}, {cause}", with_it.best_s, "s"))
    show("programs under models with a history", rows, "best of five")


if __name__ == "__main__":
    main()
