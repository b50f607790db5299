"""Variables that an error may follow, with direction of motion.

A variable is a column in time order by blocks. Its kind decides which effects make sense: turns for angles, order for
times.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats


class Kind(StrEnum):
    """What a variable is."""

    TIME = "time"
    ANGLE = "angle"
    LENGTH = "length"
    SPEED = "speed"
    FORCE = "force"
    TEMPERATURE = "temperature"
    ANY = "any"


TRAVELS = frozenset({Kind.ANGLE, Kind.LENGTH, Kind.FORCE, Kind.ANY})
"""Kinds of which the direction of travel may matter: play, friction and hysteresis follow them."""

CONTINUOUS = 0.1
"""Share of its range that a variable that is sampled along a path changes from one row to the next, at the most, half of the time;
one that jumps from pose to pose has no speed."""

MANY = 10
"""Different values that suffice for every effect."""

STILL = 1e-9
"""Share of its range by which a variable must change from one row to the next to have moved."""


@dataclass(frozen=True, eq=False)
class Variable:
    """What an error may follow.

    Attributes:
        period: one turn of an angle, in its unit; else None.
        driven: results from the simulation, so may be caused by the difference.
        range: of the rows that effects were fitted to, if these are others.
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
        """Return the least value that effects are fitted to."""
        return float(self.values.min()) if self.range is None else self.range[0]

    @property
    def high(self) -> float:
        """Return the greatest value that effects are fitted to."""
        return float(self.values.max()) if self.range is None else self.range[1]

    @property
    def distinct(self) -> int:
        """Return the number of different values; of other rows than the fitted ones it says nothing."""
        return len(np.unique(self.values)) if self.range is None else len(self.values) + MANY

    @property
    def extent(self) -> float:
        """Return the range."""
        return self.high - self.low

    @property
    def scaled(self) -> Floats:
        """Return values scaled to -1..1, shape (n,)."""
        return np.asarray((self.values - 0.5 * (self.low + self.high)) / (0.5 * self.extent), dtype=np.float64)

    @property
    def half_range(self) -> float:
        """Return the length of one scaled unit in the variable's unit."""
        return 0.5 * self.extent

    def travel(self, rows: slice) -> Floats:
        """Return values over consecutive rows, angles unwrapped."""
        own = self.values[rows]
        if self.period is None or self.extent > self.period:
            return own
        return np.asarray(np.unwrap(own, period=self.period), dtype=np.float64)

    def is_path(self, blocks: Sequence[slice]) -> bool:
        """Return whether the variable moves continuously, as along a path."""
        steps = [np.abs(np.diff(self.travel(rows))) for rows in blocks]
        every = np.concatenate([np.zeros(0), *steps])
        return len(every) > 0 and float(np.median(every)) < CONTINUOUS * self.extent

    def directions(self, blocks: Sequence[slice]) -> Floats:
        """Return each row's direction: 1 up, -1 down, shape (n,).

        Along a path by speed; between poses by arrival. Stationary rows keep the last direction; before a block's first
        move, the next.
        """
        return _signs(self, blocks, _central if self.is_path(blocks) else _arriving)

    def arriving(self, blocks: Sequence[slice]) -> Floats:
        """Return directions by the previous row alone, for ambiguous turns."""
        return _signs(self, blocks, _arriving)

    def rates(self, time: Floats, blocks: Sequence[slice]) -> Floats:
        """Return central differences per time within blocks, shape (n,); zero if time does not advance."""
        found = np.zeros(len(self.values))
        for rows in blocks:
            own, at = self.travel(rows), time[rows]
            if len(own) > 1 and np.all(np.diff(at) > 0.0):
                found[rows] = np.gradient(own, at)
        return found


def _arriving(values: Floats) -> Floats:
    return np.diff(values, prepend=values[:1])


def _central(values: Floats) -> Floats:
    return np.gradient(values) if len(values) > 1 else np.zeros(len(values))


def _signs(variable: Variable, blocks: Sequence[slice], change_of: Callable[[Floats], Floats]) -> Floats:
    found = np.zeros(len(variable.values))
    for rows in blocks:
        change = change_of(variable.travel(rows))
        moved = np.where(np.abs(change) > STILL * variable.extent, np.sign(change), 0.0)
        first = int(np.argmax(moved != 0.0)) if moved.any() else 0
        last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), first))
        found[rows] = moved[last] if len(moved) else moved
    return found
