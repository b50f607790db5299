"""Held-out error of a whole selection: everything is chosen anew from the rows that are left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.inference.channel import Channel
    from dbbstation.inference.settled import Settled

FOLDS = 10
"""Stretches of rows that are held back in turn, where there are not enough blocks."""

ENOUGH_BLOCKS = 5
"""Blocks from which on whole blocks are held back."""


@dataclass(frozen=True)
class Fold:
    """One part that was held back.

    Attributes:
        name: of the part.
        rows: how many.
        as_simulated: root mean square error with nothing fitted but the mean of the other parts, in the unit of the residual.
        before: with the base fitted to the other parts by ordinary least squares.
        after: with what was chosen from the other parts.
    """

    name: str
    rows: int
    as_simulated: float
    before: float
    after: float


@dataclass(frozen=True)
class HeldOutError:
    """What predictions leave of rows that took no part in choosing or fitting.

    Attributes:
        folds: each part.
    """

    folds: tuple[Fold, ...]

    @property
    def as_simulated(self) -> float:
        """Over all parts, with nothing fitted but a mean."""
        return self._all([fold.as_simulated for fold in self.folds])

    @property
    def before(self) -> float:
        """Over all parts, with the base refitted by ordinary least squares."""
        return self._all([fold.before for fold in self.folds])

    @property
    def after(self) -> float:
        """Over all parts, with what was chosen."""
        return self._all([fold.after for fold in self.folds])

    def _all(self, errors: list[float]) -> float:
        counts = np.array([fold.rows for fold in self.folds], dtype=np.float64)
        return float(np.sqrt(np.sum(counts * np.square(errors)) / counts.sum()))


def held_out_error(
    channel: Channel,
    choose_without: Callable[[Channel, NDArray[np.bool_]], Settled],
    progress: Callable[[str, int, int], None] = lambda _text, _done, _of: None,
) -> HeldOutError:
    """Hold back parts in turn: blocks where there are five or more, else ten stretches of consecutive rows.

    Args:
        channel: all rows.
        choose_without: the whole selection, laws, patterns, noise and looks, without rows that are held back, shape (n,).
        progress: called with what is being done, and how much of how much.
    """
    found = []
    parts = parts_of(channel)
    for done, (name, rows) in enumerate(parts):
        progress("held-out part", done, len(parts))
        settled = choose_without(channel, rows)
        simulated = channel.residual - float(np.mean(channel.residual[~rows]))
        refitted = channel.residual - channel.base.samples @ channel.without(rows).refitted()
        corrected = channel.residual - settled.predicted()
        errors = (_rms(errors[rows]) for errors in (simulated, refitted, corrected))
        found.append(Fold(name, int(rows.sum()), *errors))
    return HeldOutError(tuple(found))


def parts_of(channel: Channel) -> list[tuple[str, NDArray[np.bool_]]]:
    """Parts that are held back, with a name each: rows, shape (n,)."""
    number = np.zeros(len(channel.residual), dtype=np.int64)
    if len(channel.blocks) >= ENOUGH_BLOCKS:
        # More blocks than folds: neighbours go together.
        for k, rows in enumerate(channel.blocks):
            number[rows] = k * min(FOLDS, len(channel.blocks)) // len(channel.blocks)
    else:
        number = np.arange(len(number)) * FOLDS // len(number)
    found = []
    for k in range(int(number.max()) + 1):
        rows = number == k
        ends = np.flatnonzero(rows)
        found.append((f"rows {ends[0] + 1} to {ends[-1] + 1}", rows))
    return found


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
