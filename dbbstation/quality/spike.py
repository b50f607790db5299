"""Detect single readings that differ from their neighbours: bad contact, cable, short knock."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.noise import LEAST_UM
from dbbstation.computing.arrays import median_of, place_of_largest
from dbbstation.quality.bump import FEWEST, largest_at, near_reversals
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.limits import ROBUST_SHARE, largest_of, scale_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Flags, Floats

BESIDE = 2
"""Readings on each side whose median is compared with a reading. A spike of one or two readings does not change the
median; a straight line over five readings gives zero difference."""

SMALLEST_BLOCK, LARGEST_BLOCK, BLOCKS = 20, 100, 36
"""Limits of a block's readings, and the approximate number of blocks per turn. The scatter is estimated by blocks,
because the machine may shake for a while."""

TAIL, TAIL_SIGMAS = 0.99, 2.575829
"""A quantile that also estimates the scatter, and its value for a standard normal variable. Readings in coarse steps
have many zero differences, which lower the median; fewer than one reading in a hundred is a spike."""

REVERSAL_DEG = 1.0
"""Range about a strut's reversal in which its spike may appear [deg]. Without filtering, only lag and clock shift it."""

UNEVEN = 1.5
"""If readings are farther apart than this many usual steps, samples between them are lost, and neighbours are not compared."""


def spike(one: CircleAnalysis, reversals_deg: Sequence[float]) -> Finding:
    """Judge the reading that differs most from its neighbours."""
    # Each reading is compared with the median of two readings before and two after. The scatter of differences is the
    # larger of the turn's scatter and the local scatter; single spikes do not raise it. The reading step is added to
    # the limit. Near reversals the limit follows from the turn's other reversals. A sound normal run has a finding with
    # probability `limits.SHARE`.
    apart, sound = _apart(one.residual_um, one.raw.phi_deg)
    if int(sound.sum()) < LARGEST_BLOCK:
        return undecided(Name.SPIKE, "too few samples to hold single readings against their neighbours")
    near = near_reversals(one.raw.theta_deg, reversals_deg, REVERSAL_DEG)
    scale, freedom = _scales(apart, sound & (near < 0))
    rounding = one.noise.resolution_um
    away = np.flatnonzero(sound & (near < 0))
    candidates: list[tuple[float, float, int]] = []
    if len(away) >= LARGEST_BLOCK:
        limits = largest_of(len(away), freedom) * scale[away] + rounding
        worst = place_of_largest(np.abs(apart[away]) / limits)
        candidates.append((abs(float(apart[away[worst]])), float(limits[worst]), int(away[worst])))
    tops = [
        largest_at(apart, np.flatnonzero(sound & (near == number))) for number in np.unique(near[sound & (near >= 0)])
    ]
    for k, top in enumerate(tops):
        others = [float(apart[other]) for j, other in enumerate(tops) if j != k]
        if len(others) >= FEWEST:
            usual, known = scale_of(others)
            limit = largest_of(len(tops), known) * max(usual, float(scale[top])) + rounding
            candidates.append((abs(float(apart[top])), limit, top))
    if not candidates:
        return undecided(Name.SPIKE, "a strut turns round everywhere: single readings cannot be judged")
    height_um, limit_um, at = max(candidates, key=lambda each: each[0] / each[1])
    place = f"{apart[at]:+.1f} µm beside its neighbours at {one.raw.theta_deg[at]:.1f} degrees"
    more = sum(size > limit for size, limit, _ in candidates)
    over = int(np.sum(np.abs(apart[away]) > limits)) if len(away) >= LARGEST_BLOCK else 0
    many = f", one of {max(over, more)}" if max(over, more) > 1 else ""
    return found(
        Name.SPIKE,
        height_um,
        limit_um,
        f"no reading leaves its neighbours: at most {place}",
        f"a reading stands {place}{many}, and G holds it",
        f"spike {place}",
    )


def _apart(values_um: Floats, phi_deg: Floats) -> tuple[Floats, Flags]:
    count = len(values_um)
    apart, sound = np.zeros(count), np.zeros(count, dtype=np.bool_)
    if count <= 2 * BESIDE:
        return apart, sound
    windows = np.lib.stride_tricks.sliding_window_view(values_um, 2 * BESIDE + 1)
    beside = np.delete(windows, BESIDE, axis=1)
    inner = slice(BESIDE, count - BESIDE)
    apart[inner] = values_um[inner] - np.median(beside, axis=1)
    steps = np.diff(phi_deg)
    even = np.abs(steps) <= UNEVEN * median_of(np.abs(steps))
    sound[inner] = np.lib.stride_tricks.sliding_window_view(even, 2 * BESIDE).all(axis=1)
    return apart, sound


def _scales(apart: Floats, among: Flags) -> tuple[Floats, float]:
    count = len(apart)
    whole, _ = scale_of(list(apart[among]))
    if among.any():
        whole = max(whole, float(np.quantile(np.abs(apart[among]), TAIL)) / TAIL_SIGMAS)
    block = min(max(count // BLOCKS, SMALLEST_BLOCK), LARGEST_BLOCK)
    blocks = max(count // block, 1)
    edges = np.linspace(0, count, blocks + 1).astype(np.int64)
    own = np.full(blocks, whole)
    for k, (begin, end) in enumerate(pairwise(edges)):
        there = apart[begin:end][among[begin:end]]
        if len(there) >= SMALLEST_BLOCK // 2:
            own[k], _ = scale_of(list(there))
    beside = np.maximum(own, np.maximum(np.append(own[1:], own[-1]), np.insert(own[:-1], 0, own[0])))
    each = np.repeat(np.maximum(beside, whole), np.diff(edges))
    # Neighbouring differences share readings, so about half of them are independent.
    return np.maximum(each, LEAST_UM), ROBUST_SHARE * float(among.sum()) / 2.0
