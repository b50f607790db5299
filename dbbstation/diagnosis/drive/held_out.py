"""Gains of causes in held-out parts of recordings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import COULOMB, source_of
from dbbstation.diagnosis.drive.findings import HeldOutForce
from dbbstation.diagnosis.drive.moving import within
from dbbstation.inference.folds import parts_of
from dbbstation.inference.followed import ChosenWithoutParts, WithoutPart, left_without
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
    parts = parts_of(channel)
    gap = int(np.ceil(GAP_PERIODS / drive.scale.cutoff_hz / drive.recordings.samples_apart_s))
    brought: dict[str, list[float]] = {source: [0.0] * len(parts) for source in drive.sources}
    reference = corrected = 0.0
    without: list[WithoutPart] = []
    for number, (_, rows) in enumerate(parts):
        progress(f"held-out part {number + 1} of {len(parts)}")
        kept = channel.without(within(rows, gap))
        settled = settle(kept, most_expanded=0, most_looks=1, thorough=False, rivals=False)
        without.append(WithoutPart(rows, settled))
        patterns = settled.bank.patterns
        own = {name: source_of(drive, patterns, name) for name in settled.best.names}
        in_time = {name for name in own if name in patterns and "time" in [v.name for v in patterns[name].variables]}

        error = partial(_error, settled, rows, in_time)
        whole = error(())
        corrected += whole
        reference += error([name for name, source in own.items() if source != COULOMB])
        for source in {*own.values()} - {""}:
            brought[source][number] = error([name for name, of in own.items() if of == source]) - whole
    count = len(channel.residual)
    lengths = tuple(int(rows.sum()) for _, rows in parts)
    gains = {source: Gains(tuple(each), lengths) for source, each in brought.items() if any(each)}
    errors = float(np.sqrt(reference / count)), float(np.sqrt(corrected / count))
    found = HeldOutForce(len(parts), *errors, is_worse(errors[1], errors[0]), gains)
    return found, ChosenWithoutParts(without)


GAP_PERIODS = 0.5
"""Gap on each side of a part, in cut-off periods; beyond, the low-pass's impulse response is below a tenth."""


def _error(settled: Settled, rows: Flags, in_time: Collection[str], without: Collection[str]) -> float:
    return squares(left_without(settled, without, in_time)[rows])
