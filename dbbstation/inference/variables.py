"""Variables that an error may follow, with directions of motion.

A variable is a column, in time order within blocks. Its kind decides which effects are tried, such as waves of a turn
for angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.triangle import ROUNDING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats


class Kind(StrEnum):
    """Kinds of variables."""

    TIME = "time"
    ANGLE = "angle"
    LENGTH = "length"
    SPEED = "speed"
    FORCE = "force"
    TEMPERATURE = "temperature"
    ANY = "any"


TRAVELS = frozenset({Kind.ANGLE, Kind.LENGTH, Kind.FORCE, Kind.ANY})
"""Kinds whose direction of travel may matter, for play, friction and hysteresis."""

CONTINUOUS = 0.1
"""Largest median change between rows, relative to the range, of a variable sampled along a path; between separate poses
there is no speed."""

MANY = 10
"""Number of different values that suffices for every effect."""


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable that an error may follow.

    Attributes:
        period: one turn of an angle, in its unit; else None.
        driven: True if it results from the simulation, so the difference may cause it.
        range: range of the fitted rows, if different.
    """

    name: str
    unit: str
    kind: Kind
    values: Floats
    period: float | None = None
    driven: bool = False
    range: tuple[float, float] | None = None

    @property
    def low(self) -> float:
        """Return the least fitted value."""
        return float(self.values.min()) if self.range is None else self.range[0]

    @property
    def high(self) -> float:
        """Return the greatest fitted value."""
        return float(self.values.max()) if self.range is None else self.range[1]

    @property
    def distinct(self) -> int:
        """Return the number of different values; meaningless for rows that were not fitted."""
        return len(np.unique(self.values)) if self.range is None else len(self.values) + MANY

    @property
    def extent(self) -> float:
        """Return the range."""
        return self.high - self.low

    @property
    def scaled(self) -> Floats:
        """Return values scaled to -1..1, shape (n,)."""
        return (self.values - 0.5 * (self.low + self.high)) / (0.5 * self.extent)

    @property
    def half_range(self) -> float:
        """Return the length of one scaled unit in the variable's unit."""
        return 0.5 * self.extent

    def travel(self, rows: slice) -> Floats:
        """Return values over consecutive rows, angles unwrapped."""
        own = self.values[rows]
        if self.period is None or self.extent > self.period:
            return own
        return np.unwrap(own, period=self.period)

    def is_path(self, blocks: Sequence[slice]) -> bool:
        """Return whether the variable changes continuously, as along a path."""
        steps = [np.abs(np.diff(self.travel(rows))) for rows in blocks]
        every = np.concatenate([np.zeros(0), *steps])
        return len(every) > 0 and float(np.median(every)) < CONTINUOUS * self.extent

    def directions(self, blocks: Sequence[slice]) -> Floats:
        """Return each row's direction: 1 up, -1 down, shape (n,).

        Along a path, speed gives the direction; between poses, the previous pose. Stationary rows keep the last
        direction; before a block's first motion they have the next direction.
        """
        central = self.is_path(blocks)
        return _signs(self, blocks, lambda own: np.gradient(own) if central and len(own) > 1 else _arriving(own))

    def arriving(self, blocks: Sequence[slice]) -> Floats:
        """Return directions from the previous row alone, for ambiguous turning points."""
        return _signs(self, blocks, _arriving)

    def rates(self, time: Floats, blocks: Sequence[slice]) -> Floats:
        """Return speeds by central differences within blocks, shape (n,); zero if time does not advance."""
        found = np.zeros(len(self.values))
        for rows in blocks:
            own, at = self.travel(rows), time[rows]
            if len(own) > 1 and np.all(np.diff(at) > 0.0):
                found[rows] = np.gradient(own, at)
        return found


def _arriving(values: Floats) -> Floats:
    return np.diff(values, prepend=values[:1])


def _signs(variable: Variable, blocks: Sequence[slice], change_of: Callable[[Floats], Floats]) -> Floats:
    found = np.zeros(len(variable.values))
    for rows in blocks:
        change = change_of(variable.travel(rows))
        moved = np.where(np.abs(change) > ROUNDING * variable.extent, np.sign(change), 0.0)
        first = int(np.argmax(moved != 0.0)) if moved.any() else 0
        last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), first))
        found[rows] = moved[last] if len(moved) else moved
    return found
