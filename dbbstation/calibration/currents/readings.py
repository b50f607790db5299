"""Usable readings of motor currents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats

FEWEST = 20
"""Readings of a motor that say something."""

CLIPPED_SAMPLES = 20
CLIPPED_RATIO = 5.0
"""Readings at one limit, and how many times more than at the next value inside it: at the crest of a wave that is read in
steps the last step has two or three times as many readings as the one before; an amplifier at its limit has all of them."""


def cleaned(labels: Sequence[str], current_a: Sequence[Floats]) -> tuple[list[Floats], list[str]]:
    """Return currents with NaN at unusable readings, and notes in words, by motor.

    Args:
        current_a: per run, shape (n, 6), NaN for a motor without log.
    """
    kept = [current.copy() for current in current_a]
    notes: list[str] = []
    for motor in range(STRUTS):
        notes += _of_motor(f"motor {motor + 1}", labels, [current[:, motor] for current in kept])
    return kept, notes


def one_way(growing: Sequence[NDArray[np.bool_]], usable: Sequence[NDArray[np.bool_]]) -> list[str]:
    """Name motors whose struts never reverse, shapes (n, 6) per run."""
    notes = []
    for motor in range(STRUTS):
        ways = np.unique(
            np.concatenate([way[rows[:, motor], motor] for way, rows in zip(growing, usable, strict=True)])
        )
        if len(ways) == 1:
            notes.append(
                f"motor {motor + 1}: its strut only {'grows' if ways[0] else 'shrinks'} in these recordings: constant "
                "friction and asymmetry are known as one, gain and friction by load as well where the load keeps its "
                "sign; measure both directions of a circle to take them apart"
            )
    return notes


def _of_motor(name: str, labels: Sequence[str], current: Sequence[Floats]) -> list[str]:
    logged = [k for k, values in enumerate(current) if np.isfinite(values).any()]
    if not logged:
        return [f"{name}: its current was not logged; nothing is said of its drive, the other motors count"]
    notes = []
    if len(logged) < len(labels):
        notes.append(f"{name}: not logged in {_listed([label for k, label in enumerate(labels) if k not in logged])}")
    dead = [k for k in logged if np.nanmax(current[k]) == np.nanmin(current[k])]
    if len(dead) == len(logged):
        stands = (
            f"{name}: its current stands still at {np.nanmax(current[dead[0]]):g} A throughout, a channel that is dead"
        )
        notes.append(f"{stands} or not connected; nothing is said of its drive, the other motors count")
    elif dead:
        notes.append(f"{name}: its current stands still in {_listed([labels[k] for k in dead])}; left out there")
    for k in dead:
        current[k][:] = np.nan
    every = np.concatenate([values[np.isfinite(values)] for values in current])
    for limit in _limits(every):
        notes.append(
            f"{name}: its current stops at {limit:g} A, in {100.0 * float(np.mean(every == limit)):.1f} % of the "
            "readings: the channel saturates; these readings are left out"
        )
        for values in current:
            values[values == limit] = np.nan
    return notes


def _limits(values: Floats) -> list[float]:
    levels, count = np.unique(values, return_counts=True)
    few = 3
    if len(levels) < few:
        return []
    ends = ((levels[-1], count[-1], count[-2]), (levels[0], count[0], count[1]))
    return [float(at) for at, there, next_to in ends if there >= CLIPPED_SAMPLES and there > CLIPPED_RATIO * next_to]


def _listed(labels: Sequence[str]) -> str:
    most = 3
    return ", ".join(labels) if len(labels) <= most else f"{', '.join(labels[:most])} and {len(labels) - most} more"
