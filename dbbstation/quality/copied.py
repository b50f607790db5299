"""Detect readings that occur in two runs: a file stored twice, a repeating player, a wrong name.

Two runs of one circle share their form, but not their noise. `quality.held` bounds the probability p that a reading
equals a given one. A common stretch of k readings has at most the probability p^k times the numbers of possible starts
in both runs.
"""

from __future__ import annotations

from math import ceil, log, sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.held import chance_equal, chance_of, moving_noise
from dbbstation.quality.limits import quantile

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats
    from dbbstation.quality.knowledge import Seen

PROBABILITY = 1e-9
"""Probability that a sound run shares a stretch with another by chance, negligible in the false alarms of all findings.
A copy has hundreds of equal readings; some tens suffice."""

ROUGHLY = 0.1
"""Quantile of neighbours' differences that estimates the step of readings. Steps of a fifth of the noise or more are
found exactly. For finer steps it gives an eighth of the noise, which requires longer stretches and is thus safe. Single
odd readings do not matter."""

BASE = 0x9E3779B97F4A7C15
"""Odd factor for hashing a stretch of readings modulo 2^64, from the golden ratio [Knuth 6.4]."""


def copied(one: Seen, others: Sequence[Seen]) -> Finding:
    """Judge how many of the turn's readings occur in the same order in another run."""
    assert one.analysis is not None  # noqa: S101 - asked before
    raw = one.analysis.raw
    chance = _chance(one.analysis)
    if chance >= 1.0:
        return undecided(Name.COPIED, "the step of the readings is not finer than their noise")
    them = [(other, other.analysis.raw.length_mm) for other in others if other.analysis is not None]
    places = len(raw) * max(sum(len(length) for _, length in them), 1)
    row = 1 + ceil(log(places / PROBABILITY) / -log(chance))
    share, label = 0.0, ""
    block = (row + 1) // 2
    length = 1 << (block.bit_length() - 1)
    begins = _stretches(raw.length_mm, length)[: max(len(raw) - block + 1, 0) : block]
    for other, length_mm in them:
        shares = min(len(raw), len(length_mm)) >= row and _may_share(begins, other, length)
        there = _shared(raw.length_mm, length_mm, row) / len(raw) if shares else 0.0
        if there > share:
            share, label = there, other.run.label
    stated = f"{100.0 * share:.0f} % of the readings are those of run {label}, in their order"
    return found(
        Name.COPIED,
        100.0 * share,
        100.0 * (row - 1) / len(raw),
        "no stretch of readings stands in another run",
        f"{stated}: one file came in twice, or a player repeats itself",
        f"the readings are those of run {label}",
    )


def _chance(analysis: CircleAnalysis) -> float:
    noise = analysis.noise
    if not noise.known or not np.ptp(analysis.raw.length_mm):
        return 1.0
    squares_mm2, count, _ = moving_noise(analysis.raw)
    differs = np.abs(np.diff(analysis.raw.length_mm))
    step_mm = float(np.quantile(differs[differs > 0.0], ROUGHLY))
    # With few samples, second differences contain the form.
    known = max(1.0 - quantile(np.inf) / sqrt(2.0 * noise.reading_freedom), 0.0)
    by_turn = chance_equal(squares_mm2, count, step_mm)
    return max(by_turn, chance_of((1e-3 * known * noise.reading_um) ** 2, step_mm))


def _may_share(begins: NDArray[np.uint64], other: Seen, length: int) -> bool:
    """Return whether two neighbouring blocks of a run start with readings that another run contains in succession."""
    # If not, `_shared` is zero. Stretches of the other run are sorted once per length, a power of two.
    assert other.analysis is not None  # noqa: S101 - asked before
    if length not in other.stretches:
        other.stretches[length] = np.sort(_stretches(other.analysis.raw.length_mm, length))
    known = other.stretches[length]
    at = known[np.minimum(np.searchsorted(known, begins), len(known) - 1)] == begins
    return bool(np.any(at[1:] & at[:-1]))


def _shared(own_mm: Floats, other_mm: Floats, row: int) -> int:
    """Return the number of readings in stretches common to two runs."""
    # Blocks have half the length that chance allows, so every longer common stretch contains a whole block.
    block = (row + 1) // 2
    if min(len(own_mm), len(other_mm)) < row:
        return 0
    hashed = _stretches(other_mm, block)
    at = np.isin(_stretches(own_mm, block)[::block], hashed)
    # Two successive blocks form a stretch of `row` readings.
    both = at[1:] & at[:-1]
    counted = np.append(both, False) | np.insert(both, 0, False)
    return block * int(np.count_nonzero(counted))


def _stretches(length_mm: Floats, block: int) -> NDArray[np.uint64]:
    weights = np.array([pow(BASE, k, 2**64) for k in range(block)], dtype=np.uint64)
    return np.convolve(np.ascontiguousarray(length_mm).view(np.uint64), weights, mode="valid")
