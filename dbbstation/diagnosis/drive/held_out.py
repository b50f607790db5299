"""Gains of causes in held-out parts of recordings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import COULOMB, source_of
from dbbstation.diagnosis.drive.findings import HeldOutForce
from dbbstation.inference.folds import selections_without
from dbbstation.inference.followed import ChosenWithoutParts, left_without
from dbbstation.inference.settle import settle
from dbbstation.inference.triangle import squares
from dbbstation.inference.verdict import Gains, is_worse

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from dbbstation.computing.arrays import Flags
    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.inference.settled import Settled


def held_out(drive: DriveChannel, progress: Callable[[str], None]) -> tuple[HeldOutForce, ChosenWithoutParts]:
    """Hold out whole recordings if there are five, else ten stretches with gaps for the filter."""
    channel = drive.channel
    gap = GAP_PERIODS / drive.scale.cutoff_hz / drive.recordings.samples_apart_s
    choose = partial(settle, most_expanded=0, most_looks=1, thorough=False, rivals=False)
    parts = selections_without(
        channel, choose, lambda text, done, of: progress(f"{text} {done + 1} of {of}"), alike=gap
    )
    brought: dict[str, list[float]] = {source: [0.0] * len(parts) for source in drive.sources}
    reference = corrected = 0.0
    for number, part in enumerate(parts):
        settled, patterns = part.settled, part.settled.bank.patterns
        own = {name: source_of(drive, patterns, name) for name in settled.best.names}
        in_time = {name for name in own if name in patterns and "time" in [v.name for v in patterns[name].variables]}

        error = partial(_error, settled, part.rows, in_time)
        whole = error(())
        corrected += whole
        reference += error([name for name, source in own.items() if source != COULOMB])
        for source in {*own.values()} - {""}:
            brought[source][number] = error([name for name, of in own.items() if of == source]) - whole
    count = len(channel.residual)
    lengths = tuple(int(part.rows.sum()) for part in parts)
    gains = {source: Gains(tuple(each), lengths) for source, each in brought.items() if any(each)}
    errors = float(np.sqrt(reference / count)), float(np.sqrt(corrected / count))
    found = HeldOutForce(len(parts), *errors, is_worse(errors[1], errors[0]), gains)
    return found, ChosenWithoutParts(parts)


GAP_PERIODS = 0.5
"""Gap on each side of a part, in cut-off periods; beyond, the low-pass's impulse response is below a tenth."""


def _error(settled: Settled, rows: Flags, in_time: Collection[str], without: Collection[str]) -> float:
    return squares(left_without(settled, without, in_time)[rows])
