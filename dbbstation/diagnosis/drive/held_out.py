"""Causes' gains in unused parts of recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.findings import HeldOutForce
from dbbstation.diagnosis.drive.fit import RowsKept
from dbbstation.diagnosis.drive.moving import within
from dbbstation.diagnosis.drive.naming import COULOMB, source_of
from dbbstation.inference.folds import parts_of
from dbbstation.inference.followed import ChosenWithoutParts, WithoutPart
from dbbstation.inference.settle import settle
from dbbstation.inference.verdict import Gains, is_worse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled


def held_out(drive: DriveChannel, progress: Callable[[str], None]) -> tuple[HeldOutForce, ChosenWithoutParts]:
    """Hold back whole recordings if there are five, else ten stretches without the filter's reach."""
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
        chosen = settled.best.members
        of_chosen = RowsKept(drive, settled, chosen)

        def error(
            members: Sequence[Member],
            settled: Settled = settled,
            of_chosen: RowsKept = of_chosen,
            rows: NDArray[np.bool_] = rows,
        ) -> float:
            return float(np.sum(_left(drive, settled, of_chosen, members)[rows] ** 2))

        whole = error(chosen)
        corrected += whole
        reference += error([m for m in chosen if source_of(drive, settled.bank.patterns, m.cause.name) == COULOMB])
        for source in {source_of(drive, settled.bank.patterns, m.cause.name) for m in chosen} - {""}:
            others = [m for m in chosen if source_of(drive, settled.bank.patterns, m.cause.name) != source]
            brought[source][number] = error(others) - whole
    count = len(channel.residual)
    lengths = tuple(int(rows.sum()) for _, rows in parts)
    gains = {source: Gains(tuple(each), lengths) for source, each in brought.items() if any(each)}
    errors = float(np.sqrt(reference / count)), float(np.sqrt(corrected / count))
    found = HeldOutForce(len(parts), *errors, is_worse(errors[1], errors[0]), gains)
    return found, ChosenWithoutParts(without)


GAP_PERIODS = 0.5
"""Periods of the cut-off about a part that are left out beside it: the impulse response of the low-pass is a tenth beyond."""


def _left(drive: DriveChannel, settled: Settled, of_chosen: RowsKept, members: Sequence[Member]) -> NDArray[np.float64]:
    values, columns = of_chosen.solved(members)
    first = drive.channel.base.samples.shape[1]
    used = np.ones(len(values), dtype=bool)
    for member in members:
        width = len(member.columns)
        pattern = settled.bank.patterns.get(member.cause.name)
        if pattern is not None and any(variable.name == "time" for variable in pattern.variables):
            used[first : first + width] = False
        first += width
    return np.asarray(drive.channel.residual - columns[:, used] @ values[used], dtype=np.float64)
