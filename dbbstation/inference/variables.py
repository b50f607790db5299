"""Variables of a channel: what an error of it may follow, and which way each was moving.

A variable is a column of values in time order, with the blocks (runs, files, days) that it was recorded in. It has a kind,
which says what makes sense over it: only angles have turns, only times have an order of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


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

STILL = 1e-9
"""Share of its range by which a variable must change from one row to the next to have moved."""


@dataclass(frozen=True, eq=False)
class Variable:
    """What an error may follow.

    Attributes:
        name: unique in its channel.
        unit: of its values; empty where none is known.
        values: in row order, shape (n,).
        period: of an angle, one turn, in its unit; None for all others.
        driven: whether it results from what is simulated, so that the difference may cause it and not the other way round.
    """

    name: str
    unit: str
    kind: Kind
    values: NDArray[np.float64]
    period: float | None = None
    driven: bool = False

    @property
    def low(self) -> float:
        """Least value."""
        return float(self.values.min())

    @property
    def high(self) -> float:
        """Greatest value."""
        return float(self.values.max())

    @property
    def extent(self) -> float:
        """Of its values."""
        return self.high - self.low

    @property
    def scaled(self) -> NDArray[np.float64]:
        """Values from -1 at the least to 1 at the greatest, shape (n,)."""
        return np.asarray((self.values - 0.5 * (self.low + self.high)) / (0.5 * self.extent), dtype=np.float64)

    @property
    def half_range(self) -> float:
        """What one unit of `scaled` is, in the unit of the variable."""
        return 0.5 * self.extent

    def travel(self, rows: slice) -> NDArray[np.float64]:
        """Values over rows that follow one another; an angle that is given within one turn goes on beyond it."""
        own = self.values[rows]
        if self.period is None or self.extent > self.period:
            return own
        return np.asarray(np.unwrap(own, period=self.period), dtype=np.float64)

    def is_path(self, blocks: Sequence[slice]) -> bool:
        """Whether it moves on from row to row, as along a path, rather than from pose to pose."""
        steps = [np.abs(np.diff(self.travel(rows))) for rows in blocks]
        every = np.concatenate([np.zeros(0), *steps])
        return len(every) > 0 and float(np.median(every)) < CONTINUOUS * self.extent

    def directions(self, blocks: Sequence[slice]) -> NDArray[np.float64]:
        """Direction of travel at each row: 1 up, -1 down, shape (n,).

        Along a path that of its speed there; from pose to pose that in which it arrived. What rests keeps the direction in which
        it came; before the first move of a block it has that of the move.
        """
        return _signs(self, blocks, _central if self.is_path(blocks) else _arriving)

    def arriving(self, blocks: Sequence[slice]) -> NDArray[np.float64]:
        """The same from the row before alone: near a turn, a row along a path may belong to either way."""
        return _signs(self, blocks, _arriving)

    def rates(self, time: NDArray[np.float64], blocks: Sequence[slice]) -> NDArray[np.float64]:
        """Change per unit of time, central differences within blocks, shape (n,); zero where time does not run on."""
        found = np.zeros(len(self.values))
        for rows in blocks:
            own, at = self.travel(rows), time[rows]
            if len(own) > 1 and np.all(np.diff(at) > 0.0):
                found[rows] = np.gradient(own, at)
        return found


def _arriving(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diff(values, prepend=values[:1])


def _central(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.gradient(values) if len(values) > 1 else np.zeros(len(values))


def _signs(
    variable: Variable, blocks: Sequence[slice], change_of: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Sign of a change by row, kept while nothing changes."""
    found = np.zeros(len(variable.values))
    for rows in blocks:
        change = change_of(variable.travel(rows))
        moved = np.where(np.abs(change) > STILL * variable.extent, np.sign(change), 0.0)
        first = int(np.argmax(moved != 0.0)) if moved.any() else 0
        last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), first))
        found[rows] = moved[last] if len(moved) else moved
    return found
