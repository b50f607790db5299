"""Recordings of a drive: even samples, dead or saturated force channels, resolution and turning points.

Turning points are extremes with a minimum return [rainflow counting with a hysteresis gate: ASTM E1049-85, sec. 5.4.4;
Amzallag et al., Int. J. Fatigue 16 (1994) 287, sec. 3.1]. A turn is a retreat beyond noise, resolution and jitter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from dbbstation.errors import CalibrationError
from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.trace.drive import DriveRecording


EVEN = 0.02
"""Negligible deviation of time stamps from even steps, in steps."""

GAP = 3.5
"""Longer steps, in usual steps, are gaps with unknown events."""

FEWEST = 100
"""Fewest gapless samples of a recording."""

TOGETHER = 5
"""Consecutive equal samples, at the greatest or least value, that count as saturated."""

DEAD_SHARE = 0.1
"""Share of a recording in one sequence of equal samples that counts as dead."""

MOST_STUCK = 0.3
"""Largest usable share of stuck samples."""


def evenly_sampled(recording: DriveRecording) -> tuple[DriveRecording, float, list[str]]:
    """Return the longest gapless stretch, interpolated if uneven beyond the rounding of times, its rate [Hz] and notes.

    Raises:
        CalibrationError: fewer than a hundred gapless samples.
    """
    notes: list[str] = []
    steps = np.diff(recording.t_s)
    usual = float(np.median(steps)) if len(steps) else 0.0
    edges = np.concatenate([[0], np.flatnonzero(steps > GAP * usual) + 1, [len(recording)]])
    longest = int(np.argmax(np.diff(edges)))
    part = slice(int(edges[longest]), int(edges[longest + 1]))
    t, position, force = recording.t_s[part], recording.position_mm[part], recording.force_n[part]
    if len(t) < FEWEST:
        raise CalibrationError(
            f"{len(t)} samples without a gap are too few, {FEWEST} are needed",
            where=recording.name,
            remedy="record for longer, ten strokes to and fro at several speeds",
        )
    if len(edges) > 2:  # noqa: PLR2004 - only start and end: no gap
        notes.append(
            f"{len(edges) - 2} gaps in the time stamps; the longest stretch without one is used, "
            f"{t[0]:g} to {t[-1]:g} s, {len(t)} of {len(recording)} samples"
        )
    count = np.arange(len(t))
    step, start = np.polyfit(count, t, 1)
    off = float(np.abs(t - (start + step * count)).max())
    if off > max(EVEN * step, 1.01 * _printed_resolution(t)):
        notes.append(
            f"the time stamps are up to {1e3 * off:.3g} ms off even steps of {1e3 * step:.4g} ms; "
            "position and force are interpolated to even steps"
        )
        even = np.linspace(t[0], t[-1], len(t))
        position, force = CubicSpline(t, position)(even), np.interp(even, t, force)
        rate = (len(t) - 1) / (t[-1] - t[0])
    else:
        even, rate = start + step * count, 1.0 / step
    return replace(recording, t_s=even, position_mm=position, force_n=force), float(rate), notes


def _printed_resolution(t: Floats) -> float:
    """Return the rounding step of times, down to a microsecond [s]; zero if finer."""
    for digits in range(7):
        if np.abs(t - np.round(t, digits)).max() < 1e-3 * 10.0**-digits:
            return float(10.0**-digits)
    return 0.0


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


RETREAT_SIGMA = 5.0
"""Least retreat in standard deviations of position: noise reaches it once in ten thousand samples at standstill."""

WHOLE = 0.02
"""Largest distance of rounded positions from whole steps, in steps; files round positions again."""


def resolution_of(position: Floats) -> float:
    """Return the position's rounding step, zero if none."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 0.0]
    if not len(steps):
        return 0.0
    least = float(np.quantile(steps, 0.001, method="lower"))
    count = np.round(steps / least)
    # Large and small steps are equally exact, so the resolution follows from all of them.
    size = float(count @ steps / (count @ count))
    return size if float(np.median(np.abs(steps / size - np.round(steps / size)))) < WHOLE else 0.0


def turning_points(position_m: Floats, retreat: float) -> Integers:
    """Return the turning samples, ascending, shape (t,)."""
    found: list[int] = []
    way = 0
    highest = lowest = 0
    values = position_m.tolist()
    for k, value in enumerate(values):
        if value > values[highest]:
            highest = k
        if value < values[lowest]:
            lowest = k
        if way >= 0 and values[highest] - value > retreat:
            if way > 0:
                found.append(highest)
            way, lowest = -1, k
        elif way <= 0 and value - values[lowest] > retreat:
            if way < 0:
                found.append(lowest)
            way, highest = 1, k
    return np.array(found, dtype=np.int64)


def ways(position_m: Floats, turns: Integers) -> Floats:
    """Return directions of travel, +1 or -1, shape (n,); zero without motion."""
    ends = np.concatenate([[0], turns, [len(position_m) - 1]])
    signs = np.sign(np.diff(position_m[ends]))
    return np.repeat(signs, np.diff(np.concatenate([[0], turns, [len(position_m)]])))
