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
    from collections.abc import Sequence

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

STILL = 1e-9
"""Share of its range by which a variable must change from one row to the next to have moved."""


@dataclass(frozen=True, eq=False)
class Variable:
    """What an error may follow.

    Attributes:
        name: unique in its channel.
        unit: of its values; empty where none is known.
        kind: what it is.
        values: in row order, shape (n,).
        period: of an angle, one turn, in its unit; None for all others.
    """

    name: str
    unit: str
    kind: Kind
    values: NDArray[np.float64]
    period: float | None = None

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

    def directions(self, blocks: Sequence[slice]) -> NDArray[np.float64]:
        """Direction in which it arrived at each row: 1 up, -1 down, shape (n,).

        What rests keeps the direction in which it came; before the first move of a block it has none, 0.
        """
        found = np.zeros(len(self.values))
        for rows in blocks:
            change = np.diff(self.values[rows], prepend=self.values[rows][:1])
            moved = np.where(np.abs(change) > STILL * self.extent, np.sign(change), 0.0)
            last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), 0))
            found[rows] = moved[last]
        return found

    def rates(self, time: NDArray[np.float64], blocks: Sequence[slice]) -> NDArray[np.float64]:
        """Change per unit of time, central differences within blocks, shape (n,); zero where time does not run on."""
        return rates_of(self.values, time, blocks)


def rates_of(values: NDArray[np.float64], time: NDArray[np.float64], blocks: Sequence[slice]) -> NDArray[np.float64]:
    """Change of values per unit of time, central differences within blocks, shape (n,)."""
    found = np.zeros(len(values))
    for rows in blocks:
        own, at = values[rows], time[rows]
        if len(own) > 1 and np.all(np.diff(at) > 0.0):
            found[rows] = np.gradient(own, at)
    return found
