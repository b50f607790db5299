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

    from dbbstation.inference.coloured import Coloured
    from dbbstation.inference.pieces import Left

PIECES = 4096
"""Pieces of rows that a stretch may begin and end at, at the most, in the first look."""

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
    choices = tuple(
        (tuple(range(k)), float(gammaln(k + 1) - (k - 1) * np.log(look.tried) - np.log(len(sizes))), f"{k} of them")
        for k in sizes
    )
    label = f"rows {first[0]} to {last[0]}" + (f" and {width - 1} more" if width > 1 else "")
    samples = form.columns(np.arange(len(kept), dtype=np.float64))
    return Pattern(
        Family.PULSES, (), samples, form, ("",) * width, (1.0,) * width, label, look.tried, choices if width > 1 else ()
    )


class _Look:
    """Sums over windows of rows: first over pieces, then every row of the best one's ends by itself."""

    def __init__(
        self, left: Left, blocks: Sequence[slice], kept: NDArray[np.bool_], size: float, shortest: int
    ) -> None:
        self._left, self._size, self._shortest = left, size, shortest
        self._rows = np.flatnonzero(kept)
        ends = np.searchsorted(self._rows, [[b.start, b.stop] for b in blocks])
        self._blocks = [(int(a), int(b)) for a, b in ends if b - a >= 2 * shortest]
        self._axes, self._rest = left.axes, left.rest
        self._total = _cumulative(left.towards)
        self._windows = self._all_windows()
        self._squares = _squares_of_stretches(left.coloured, len(self._rows))
        self._own = self._squares[self._windows[:, 1] - self._windows[:, 0]]
        self._along_axes: list[NDArray[np.float64]] = []
        for part in range(left.beside.shape[1]):
            self._beside(left.beside[:, part])
        self.tried = max(float(len(self._windows)) / INDEPENDENT, 1.0)

    def _all_windows(self) -> NDArray[np.int64]:
        """First row of each window and the one behind its last, shape (w, 2)."""
        per = max(1, int(np.ceil(len(self._rows) / PIECES)))
        found = [np.zeros((0, 2), dtype=np.int64)]
        for first, last in self._blocks:
            many = (last - first) // per
            octaves = int(np.log2(max(many, 1)) * LENGTHS_PER_OCTAVE) + 1
            lengths = np.unique(np.round(2.0 ** (np.arange(octaves) / LENGTHS_PER_OCTAVE)).astype(np.int64))
            for length in lengths[(lengths * per >= self._shortest) & (lengths < many)]:
                begin = np.arange(0, many - length + 1, max(1, int(length) // 8)) * per + first
                found.append(np.column_stack([begin, begin + length * per]))
            # To the end of the block, and to the end of all: a step.
            begin = np.arange(first, last - self._shortest + 1, per)
            found += [np.column_stack([begin, np.full(len(begin), end)]) for end in (last, len(self._rows))]
        every = np.unique(np.vstack(found), axis=0)
        return every[every[:, 1] - every[:, 0] < len(self._rows)]

    def _beside(self, axis: NDArray[np.float64]) -> None:
        """Take what an axis that was fitted has of every window out of the window's own information."""
        total = _cumulative(axis)
        self._along_axes.append(total)
        self._own = self._own - (total[self._windows[:, 1]] - total[self._windows[:, 0]]) ** 2

    def best(self) -> _Stretch | None:
        """The window that stands out most, its ends moved to where it stands out more."""
        if not len(self._windows):
            return None
        along = self._total[self._windows[:, 1]] - self._total[self._windows[:, 0]]
        first, last = (int(edge) for edge in self._windows[int(self._worth(along, self._own).argmax())])
        for _ in range(ENDS_MOVED):
            low, high = self._within(first, last)
            ends = np.arange(first + self._shortest, high + 1)
            last = int(ends[int(self._worth_of(np.full(len(ends), first), ends).argmax())])
            starts = np.arange(low, last - self._shortest + 1)
            first = int(starts[int(self._worth_of(starts, np.full(len(starts), last)).argmax())])
        worth = float(self._worth_of(np.array([first]), np.array([last]))[0])
        return _Stretch(int(self._rows[first]), int(self._rows[last - 1]), worth)

    def _within(self, first: int, last: int) -> tuple[int, int]:
        """Rows that a stretch may have: those of its block, or of all where it goes on into another one."""
        for low, high in self._blocks:
            if low <= first and last <= high:
                return low, high
        return 0, len(self._rows)

    def _worth_of(self, starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
        own = self._squares[ends - starts]
        for total in self._along_axes:
            own = own - (total[ends] - total[starts]) ** 2
        return self._worth(self._total[ends] - self._total[starts], own)

    def _worth(self, along: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log Bayes factor of each window, less what it costs to be picked from all of them."""
        information = np.maximum(own, 0.0) + 1.0 / self._size**2
        occam = 0.5 * np.log(information * self._size**2)
        return np.asarray(0.5 * along**2 / information - occam - np.log(self.tried))

    def take(self, stretch: _Stretch) -> None:
        """Go on beside a stretch."""
        column = ((self._rows >= stretch.first) & (self._rows <= stretch.last)).astype(np.float64)
        column = self._left.whitened(column)
        column = column - self._axes @ (self._axes.T @ column)
        axis = column / max(float(np.linalg.norm(column)), 1e-300)
        self._axes = np.column_stack([self._axes, axis])
        self._rest = self._rest - axis * float(axis @ self._rest)
        self._total = _cumulative(self._left.transposed(self._rest))
        self._beside(self._left.transposed(axis))


INDEPENDENT = 4.0
"""Windows that are about the same: only every so many-th counts as another try."""

ENDS_MOVED = 3
"""Times that either end of the best window is moved to where it is best."""


def _cumulative(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums of all rows before each, and of all of them, shape (n + 1,)."""
    return np.concatenate([[0.0], np.cumsum(rows)])


def _squares_of_stretches(noise: Coloured, longest: int) -> NDArray[np.float64]:
    """Sum of squares of a whitened stretch of ones by its length, 0 to `longest`, away from the ends of a block.

    It goes on behind its end until the filter has forgotten it.
    """
    taps = noise.filter
    step = np.concatenate([np.cumsum(taps), np.full(longest, taps.sum())])
    inside = np.concatenate([[0.0], np.cumsum(step[:longest] ** 2)])
    behind = [np.sum((step[k : k + len(taps)] - step[: len(taps)]) ** 2) for k in range(longest + 1)]
    return np.asarray(inside + behind, dtype=np.float64)
