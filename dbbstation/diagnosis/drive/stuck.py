"""Detect dead or saturated force channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import CalibrationError
from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats

TOGETHER = 5
"""Consecutive equal samples, at the greatest or least value, that count as saturated."""

DEAD_SHARE = 0.1
"""Share of a recording in one sequence of equal samples that counts as dead."""

MOST_STUCK = 0.3
"""Largest usable share of stuck samples."""


def stuck_samples(force_n: Floats, t_s: Floats, moving: Flags, name: str) -> tuple[Flags, list[str]]:
    """Return samples with a stuck force, shape (n,), and notes; standstill does not count.

    Raises:
        CalibrationError: the force never changes, or is mostly stuck.
    """
    if not np.ptp(force_n) > 0.0:
        raise CalibrationError(
            f"the force is {force_n[0]:g} N in every sample: the channel is dead",
            where=name,
            remedy="check the wire and the scale of the force or current channel",
        )
    changes = np.flatnonzero(np.diff(force_n) != 0.0) + 1
    starts, stops = np.r_[0, changes], np.r_[changes, len(force_n)]
    lengths, values = stops - starts, force_n[starts]
    passed = np.concatenate([[0], np.cumsum(moving)])
    while_moving = passed[stops] - passed[starts] > MOVES * lengths
    extreme = (values == force_n.max()) | (values == force_n.min())
    saturated = extreme & (lengths >= TOGETHER) & while_moving
    dead = (lengths >= DEAD_SHARE * len(force_n)) & ~saturated & while_moving
    notes = []
    for rows, what in ((saturated, "saturated: it stands at its extreme"), (dead, "dead: it does not change")):
        for at in np.flatnonzero(rows)[: BOUNDS.notes_of_stuck]:
            first, last = t_s[starts[at]], t_s[stops[at] - 1]
            notes.append(f"the force is {what}, {values[at]:g} N, from {first:.3f} to {last:.3f} s; this is not used")
        if np.count_nonzero(rows) > BOUNDS.notes_of_stuck:
            notes.append(f"and {np.count_nonzero(rows) - BOUNDS.notes_of_stuck} more such stretches")
    stuck = np.repeat(saturated | dead, lengths)
    share = float(np.mean(stuck[moving])) if moving.any() else 0.0
    if share > MOST_STUCK:
        raise CalibrationError(
            f"the force channel is stuck in {100 * share:.0f} % of the samples in which the drive moves",
            where=name,
            remedy="check the range and the wire of the channel, then record again; " + notes[0],
        )
    return stuck, notes


MOVES = 0.5
"""If the drive moves in at least this share of equal samples, the channel is faulty."""
