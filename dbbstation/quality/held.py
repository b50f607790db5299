"""A constant length: stuck plunger, stop, held display.

With white noise sigma and step r, the next reading equals any value with at most r / (sigma sqrt(2 pi)), the greatest
normal density times the step. So n equal readings have at most that to the power n - 1. A step coarser than the noise
gives no bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, log, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.limits import SHARE, quantile

if TYPE_CHECKING:
    from dbbstation.trace.circle import RawCircle

SHORTEST_S = 1.0
"""Readings that are equal for less say nothing: displays that are asked more often than they are renewed repeat themselves, the slowest
twice a second [s]."""

SECOND_DIFFERENCE = 6.0
"""Variance of x(k-1) - 2 x(k) + x(k+1) over that of white x: 1 + 4 + 1. Slow forms have next to none."""

INDEPENDENT_SHARE = 18.0 / 35.0
"""Degrees of freedom of a mean square of second differences, as share of their number: 36 / (36 + 2 (16 + 1)), from their correlations of
-4/6 and 1/6."""

ROUNDED = 1.0 / 12.0
"""Variance that rounding to a step adds to readings, in steps squared [GUM 4.3.7]."""


def chance_equal(squares_mm2: float, count: int, step_mm: float) -> float:
    """Return a bound of the probability that a sound reading repeats the last; one if unknown.

    Args:
        squares_mm2: sum of squared second differences while moving [mm²].
    """
    if not count or not 0.0 < step_mm < inf:
        return 1.0
    known = max(1.0 - quantile(inf) / sqrt(2.0 * INDEPENDENT_SHARE * count), 0.0)
    return chance_of(known**2 * squares_mm2 / count / SECOND_DIFFERENCE, step_mm)


def chance_of(variance_mm2: float, step_mm: float) -> float:
    """Return the same from a variance of readings, rounding included [mm²]."""
    finer = sqrt(max(variance_mm2 - ROUNDED * step_mm**2, 0.0) * 2.0 * pi) / step_mm
    return 1.0 / finer if finer > 1.0 else 1.0


def moving_noise(raw: RawCircle) -> tuple[float, int, float]:
    """Return the inputs of `chance_equal` from moving readings of a turn: squares [mm²], their number, step [mm]."""
    differs = np.abs(np.diff(raw.length_mm))
    ends = np.flatnonzero(differs)
    first, last = np.append(0, ends + 1), np.append(ends, len(raw) - 1)
    moving = np.repeat(raw.t_s[last] - raw.t_s[first] < SHORTEST_S, last - first + 1)[1:-1]
    squares = np.diff(raw.length_mm, 2)[moving] ** 2
    return float(squares.sum()), len(squares), float(np.min(differs[ends]))


def equal_limit(squares_mm2: float, count: int, step_mm: float, readings: float) -> float:
    """Return the number of equal readings in a row that a sound turn has with probability SHARE at most; infinite for a coarse step."""
    chance = chance_equal(squares_mm2, count, step_mm)
    return 1.0 + ceil(log(max(readings, 1.0) / SHARE) / -log(chance)) if chance < 1.0 else inf


@dataclass
class HeldLength:
    """Takes readings of a turn and reports an unusually long standstill.

    Attributes:
        since_s: first of the last equal readings.
        step_mm: smallest difference so far; infinite before two differ.
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
        """Begin another run; the noise is kept."""
        self.equal, self._last, self._before, self._pending = 0, None, None, 0.0

    def add(self, t_s: float, length_mm: float, *, noise: bool = True) -> None:
        """Take a reading; noise is measured at least once a second of motion.

        Args:
            noise: whether differences are noise; False during feed-out.
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
        """Return whether the length is constant, unlike sound readings.

        Args:
            readings: of a whole turn, approximately.
        """
        if self.held_s < SHORTEST_S:
            return False
        return self.equal > equal_limit(self._squares, self._count, self.step_mm, readings)


def held(raw: RawCircle) -> Finding:
    """Judge the longest stretch of equal readings."""
    ends = np.flatnonzero(np.diff(raw.length_mm) != 0.0)
    if not len(ends):
        return undecided(Name.HELD, "all readings of the turn are the same: the step is not finer than the noise", "s")
    first, last = np.append(0, ends + 1), np.append(ends, len(raw) - 1)
    durations = raw.t_s[last] - raw.t_s[first]
    longest = int(np.argmax(durations))
    most = equal_limit(*moving_noise(raw), len(raw))
    value, place = float(durations[longest]), f"{raw.theta_deg[first[longest]]:.0f} degrees"
    if most == inf:
        return undecided(
            Name.HELD, f"at most {value:.1f} s; the step of the readings is not finer than their noise", "s", value
        )
    limit = max(SHORTEST_S, most * float(np.median(np.diff(raw.t_s))))
    stated = f"the length stands still for {value:.1f} s at {place}"
    return found(Name.HELD, value, limit, "s", "the length never stands still", f"{stated}: {AFTER_HELD}")


AFTER_HELD = "look after plunger, stroke and plug of the gauge, and repeat the run"
"""What to do about a length that stands still."""
