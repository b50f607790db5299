"""Steps, pulses and other transients in time: stretches of rows over which all of a residual is higher or lower.

All stretches of many lengths are tried at every place of every block; the best is taken in, and the look goes on beside it.
Nobody says when something began or how long it took. A stretch that goes on to the end of its block is a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from dbbstation.inference.curves import Stretches
from dbbstation.inference.patterns import Family, Pattern

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.pieces import Left

PIECES = 4096
"""Pieces of rows, at the most."""

LENGTHS_PER_OCTAVE = 2
"""Lengths that are tried from one to twice its length."""

MOST = 40
"""Stretches in one look, at the most."""

SHORTEST = 3
"""Rows of the shortest stretch: one row alone is a wrong value, which no effect of the object explains."""


@dataclass(frozen=True)
class _Stretch:
    first: int
    last: int
    worth: float


def stretches(
    left: Left,
    blocks: Sequence[slice],
    kept: NDArray[np.bool_],
    size: float,
    shortest: int = SHORTEST,
) -> Pattern | None:
    """Stretches of rows that stand out, as one pattern of one, two and more of them; None where none does.

    Args:
        left: what a fit leaves of the rows that were kept.
        blocks: rows of each block, in time order.
        kept: which rows were fitted, shape (n,).
        size: of an effect, one standard deviation, in units of noise.
        shortest: rows of the shortest stretch.
    """
    look = _Look(left, blocks, kept, size, shortest)
    found: list[_Stretch] = []
    while len(found) < MOST:
        best = look.best()
        if best is None or best.worth <= 0.0:
            break
        found.append(best)
        look.take(best)
    if not found:
        return None
    first, last = tuple(s.first for s in found), tuple(s.last for s in found)
    form = Stretches(first, last)
    width = len(found)
    # A pattern of k stretches is one of tried**k / k! [k places, in whatever order].
    sizes = sorted({1, 2, 3, 4, 6, 9, 13, 19, 28, width} & set(range(1, width + 1)))
    choices = tuple((k, float(gammaln(k + 1) - (k - 1) * np.log(look.tried) - np.log(len(sizes)))) for k in sizes)
    label = f"rows {first[0]} to {last[0]}" + (f" and {width - 1} more" if width > 1 else "")
    samples = form.columns(np.arange(len(kept), dtype=np.float64))
    return Pattern(
        Family.PULSES, (), samples, form, ("",) * width, (1.0,) * width, label, look.tried, choices if width > 1 else ()
    )


class _Look:
    """Sums over windows of pieces of rows, block by block."""

    def __init__(
        self, left: Left, blocks: Sequence[slice], kept: NDArray[np.bool_], size: float, shortest: int
    ) -> None:
        rows = np.flatnonzero(kept)
        per_piece = max(1, shortest, int(np.ceil(len(rows) / PIECES)))
        self._size = size
        starts: list[int] = []
        edges: list[tuple[int, int]] = []
        for block in blocks:
            own = np.flatnonzero((rows >= block.start) & (rows < block.stop))
            if len(own) < 2 * per_piece:
                continue
            first = len(starts)
            starts += [int(own[0]) + k for k in range(0, len(own) - per_piece + 1, per_piece)]
            edges.append((first, len(starts)))
        self._edges, self._rows = edges, rows
        stops = [*starts[1:], len(rows)]
        for first, last in edges:
            block_rows = np.flatnonzero((rows >= rows[starts[first]]) & (rows < self._end(blocks, rows[starts[first]])))
            stops[last - 1] = int(block_rows[-1]) + 1
        self._starts, self._stops = np.array(starts, dtype=np.int64), np.array(stops, dtype=np.int64)
        self._axes = left.axes
        self._rest = left.rest.copy()
        self._windows = self._all_windows()
        self._own = self._own_of(left.axes)
        self.tried = max(float(len(self._windows)) / 4.0, 1.0)

    @staticmethod
    def _end(blocks: Sequence[slice], row: int) -> int:
        return next(block.stop for block in blocks if block.start <= row < block.stop)

    def _all_windows(self) -> NDArray[np.int64]:
        """First and last piece of each window, shape (w, 2)."""
        found = [np.zeros((0, 2), dtype=np.int64)]
        for first, last in self._edges:
            many = last - first
            octaves = int(np.floor(np.log2(max(many, 1)) * LENGTHS_PER_OCTAVE)) + 1
            lengths = np.unique(np.round(2.0 ** (np.arange(octaves) / LENGTHS_PER_OCTAVE)).astype(np.int64))
            for length in lengths[lengths < many]:
                apart = max(1, int(length) // 8)
                begin = np.arange(first, last - length + 1, apart)
                found.append(np.column_stack([begin, begin + length - 1]))
            # To the end of the block: a step.
            begin = np.arange(first + 1, last)
            found.append(np.column_stack([begin, np.full(len(begin), last - 1)]))
        return np.unique(np.vstack(found), axis=0)

    def _over(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums of rows over all windows."""
        total = np.concatenate([np.zeros((1, *rows.shape[1:])), np.cumsum(rows, axis=0)])
        return np.asarray(
            total[self._stops[self._windows[:, 1]]] - total[self._starts[self._windows[:, 0]]], dtype=np.float64
        )

    def _own_of(self, axes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Information that each window has beside what was fitted."""
        count = (self._stops[self._windows[:, 1]] - self._starts[self._windows[:, 0]]).astype(np.float64)
        for part in range(axes.shape[1]):
            count = count - self._over(axes[:, part]) ** 2
        return np.maximum(count, 0.0)

    def best(self) -> _Stretch | None:
        """The window that stands out most, its edges moved to where it stands out more."""
        if not len(self._windows):
            return None
        worth = self._worth(self._over(self._rest), self._own)
        k = int(worth.argmax())
        a, b = self._windows[k]
        return _Stretch(int(self._rows[self._starts[a]]), int(self._rows[self._stops[b] - 1]), float(worth[k]))

    def _worth(self, along: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log Bayes factor of each window, less what it costs to be picked from all of them."""
        information = own + 1.0 / self._size**2
        occam = 0.5 * np.log(information * self._size**2)
        return np.asarray(0.5 * along**2 / information - occam - np.log(self.tried))

    def take(self, stretch: _Stretch) -> None:
        """Go on beside a stretch."""
        column = ((self._rows >= stretch.first) & (self._rows <= stretch.last)).astype(np.float64)
        column -= self._axes @ (self._axes.T @ column)
        norm = float(np.linalg.norm(column))
        axis = column / max(norm, 1e-300)
        self._axes = np.column_stack([self._axes, axis])
        self._rest = self._rest - axis * float(axis @ self._rest)
        self._own = np.maximum(self._own - self._over(axis) ** 2, 0.0)
