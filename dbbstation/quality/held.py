"""Detect a constant length: a stuck plunger, a mechanical stop, a held display.

With white noise sigma and step r, the next reading equals any given value with a probability of at most p = r / (sigma
sqrt(2 pi)), the greatest normal density times the step. So the probability of n equal readings is at most p^(n - 1). A
step coarser than the noise gives no bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, log, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import median_of, place_of_largest
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.limits import SHARE, quantile

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Integers
    from dbbstation.trace.recording import RawCircle

SHORTEST_S = 1.0
"""Shorter standstills do not count [s]: a display polled faster than it is refreshed repeats readings; the slowest is
refreshed twice a second."""

SECOND_DIFFERENCE = 6.0
"""Variance of x(k-1) - 2 x(k) + x(k+1) over that of white x: 1 + 4 + 1. Slow forms contribute hardly anything."""

INDEPENDENT_SHARE = 18.0 / 35.0
"""Degrees of freedom per second difference of their mean square: 36 / (36 + 2 (16 + 1)), from their correlations -4/6
and 1/6."""

ROUNDED = 1.0 / 12.0
"""Variance of rounding, in steps squared [GUM 4.3.7]."""


def chance_equal(squares_mm2: float, count: int, step_mm: float) -> float:
    """Return an upper bound of the probability that a sound reading repeats the last one; 1 if unknown.

    Args:
        squares_mm2: sum of squared second differences of moving readings [mm²].
    """
    if not count or not 0.0 < step_mm < inf:
        return 1.0
    known = max(1.0 - quantile(inf) / sqrt(2.0 * INDEPENDENT_SHARE * count), 0.0)
    return chance_of(known**2 * squares_mm2 / count / SECOND_DIFFERENCE, step_mm)


def chance_of(variance_mm2: float, step_mm: float) -> float:
    """Return the bound of `chance_equal` from the variance of readings, rounding included [mm²]."""
    finer = sqrt(max(variance_mm2 - ROUNDED * step_mm**2, 0.0) * 2.0 * pi) / step_mm
    return 1.0 / finer if finer > 1.0 else 1.0


ALL_EQUAL = "all readings of the turn are the same: the step is not finer than the noise"


def equal_readings(raw: RawCircle) -> tuple[Integers, Integers]:
    """Return the indices of the first and the last reading of each sequence of equal readings."""
    ends = np.flatnonzero(np.diff(raw.length_mm))
    return np.append(0, ends + 1), np.append(ends, len(raw) - 1)


def moving_noise(raw: RawCircle) -> tuple[float, int, float]:
    """Return the inputs of `chance_equal` from a turn's moving readings: sum of squares [mm²], number, step [mm]."""
    differs = np.abs(np.diff(raw.length_mm))
    first, last = equal_readings(raw)
    moving = np.repeat(raw.t_s[last] - raw.t_s[first] < SHORTEST_S, last - first + 1)[1:-1]
    squares = np.diff(raw.length_mm, 2)[moving] ** 2
    return float(squares.sum()), len(squares), float(np.min(differs[last[:-1]]))


def equal_limit(squares_mm2: float, count: int, step_mm: float, readings: float) -> float:
    """Return the number of consecutive equal readings that a sound turn reaches with a probability of at most SHARE; infinite for a coarse step."""
    chance = chance_equal(squares_mm2, count, step_mm)
    return 1.0 + ceil(log(max(readings, 1.0) / SHARE) / -log(chance)) if chance < 1.0 else inf


@dataclass
class HeldLength:
    """Detects an unusually long standstill while readings arrive.

    Attributes:
        since_s: time of the first of the last equal readings.
        step_mm: smallest difference so far; infinite until two readings differ.
    """

    since_s: float = 0.0
    equal: int = 0
    step_mm: float = inf
    _last_s: float = 0.0
    _last: float | None = None
    _before: float | None = None
    _squares: float = 0.0
    _count: int = 0
    _pending: float = 0.0

    def restart(self) -> None:
        """Begin another run, but keep the noise estimate."""
        self.equal, self._last, self._before, self._pending = 0, None, None, 0.0

    def add(self, t_s: float, length_mm: float, *, noise: bool = True) -> None:
        """Add a reading; the noise is estimated at least once per second of motion.

        Args:
            noise: whether the reading's differences are noise; False during feed-out.
        """
        if self._last is None or length_mm != self._last:
            if self._last is not None and noise:
                self.step_mm = min(self.step_mm, abs(length_mm - self._last))
            if noise and self.held_s < SHORTEST_S:
                self._count += self.equal
                self._squares += self._pending
            self.since_s, self.equal, self._pending = t_s, 0, 0.0
        if noise and self._last is not None and self._before is not None:
            self._pending += (length_mm - 2.0 * self._last + self._before) ** 2
        self.equal += 1
        self._before, self._last, self._last_s = self._last, length_mm, t_s

    @property
    def held_s(self) -> float:
        """Return the duration of the standstill [s]."""
        return self._last_s - self.since_s if self.equal else 0.0

    def stands(self, readings: float) -> bool:
        """Return whether the length is constant for longer than sound readings allow.

        Args:
            readings: approximate number on a whole turn.
        """
        if self.held_s < SHORTEST_S:
            return False
        return self.equal > equal_limit(self._squares, self._count, self.step_mm, readings)


def held(raw: RawCircle) -> Finding:
    """Judge the longest sequence of equal readings."""
    first, last = equal_readings(raw)
    if len(first) == 1:
        return undecided(Name.HELD, ALL_EQUAL)
    durations = raw.t_s[last] - raw.t_s[first]
    longest = place_of_largest(durations)
    most = equal_limit(*moving_noise(raw), len(raw))
    value, place = float(durations[longest]), f"{raw.theta_deg[first[longest]]:.0f} degrees"
    if most == inf:
        return undecided(
            Name.HELD, f"at most {value:.1f} s; the step of the readings is not finer than their noise", value
        )
    limit = max(SHORTEST_S, most * median_of(np.diff(raw.t_s)))
    stated = f"the length stands still for {value:.1f} s at {place}"
    return found(Name.HELD, value, limit, "the length never stands still", stated)
