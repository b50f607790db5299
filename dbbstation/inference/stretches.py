"""Find steps and pulses in time: stretches with a shifted residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.forms import Stretches
from dbbstation.inference.patterns import Family, Pattern

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.coloured import Coloured, Left
    from dbbstation.inference.forms import Clock

SHORTEST = 3
"""Shortest stretch in rows; a single wrong value is no effect of the object."""


@dataclass(frozen=True)
class _Window:
    first: int
    last: int
    worth: float


def stretches(left: Left, channel: Channel, size: float) -> list[Pattern]:
    """Return significant stretches as patterns of one, two and more stretches.

    Args:
        channel: with times; its directions of travel, if any, are for effects that change sign with them.
        size: prior standard deviation, over noise.
    """
    clock, ones = channel.row_clock, np.ones(len(channel.kept))
    kinds: list[tuple[Family, tuple[Variable, ...], Floats]] = [(Family.PULSES, (), ones)]
    if channel.time is not None and channel.direction is not None:
        time = Variable("time", channel.time_unit, Kind.TIME, channel.time)
        kinds.append((Family.PULSES_BY_DIRECTION, (time,), channel.direction))
    patterns = []
    for family, over, factor in kinds:
        look = _Look(left, channel, size, factor)
        found: list[tuple[float, float]] = []
        while len(found) < BOUNDS.stretches:
            best = look.best()
            if best is None or best.worth <= 0.0:
                break
            found.append(look.take(best))
        if over:
            # Without a reversal inside, the stretch equals one that ignores direction.
            ways = np.sign(factor)
            found = [(a, b) for a, b in found if {-1.0, 1.0} <= set(ways[(clock.rows > a) & (clock.rows < b)].tolist())]
        if found:
            patterns.append(_pattern(family, over, found, clock, factor, look.tried))
    return patterns


def refined(pattern: Pattern, left: Left, sd: Floats, channel: Channel, size: float) -> Pattern:
    """Return the pattern's first stretches, with optimised ends, as a pattern.

    Args:
        left: residual without the pattern.
        sd: of the stretches' priors, shape (q,).
    """
    clock, kept = channel.row_clock, channel.kept
    by = channel.direction if pattern.family is Family.PULSES_BY_DIRECTION else None
    factor = np.ones(len(kept)) if by is None else by
    form = pattern.form
    if not isinstance(form, Stretches):
        return pattern
    found = list(zip(form.first, form.last, strict=True))[: len(sd)]
    columns = left.whitened(pattern.samples[kept, : len(sd)])
    # Two stretches with a common edge may be one with a wrong edge plus a compensation. The shorter one is kept only if
    # it is still worth its odds given the others at their best places.
    doubtful = [k for k in range(len(found)) if _shares_an_edge(found, k)]
    columns[:, doubtful] = 0.0
    for k in sorted(range(len(found)), key=lambda one: one in doubtful):
        window = np.searchsorted(clock.rows[kept], [found[k]])
        # Refinement of the others may have made it too short, also at the end of the rows.
        window[0, 1] = max(window[0, 1], min(window[0, 0] + SHORTEST, int(kept.sum())))
        window[0, 0] = min(window[0, 0], window[0, 1] - SHORTEST)
        beside = left.also(np.delete(columns, k, axis=1), np.delete(sd, k))
        look = _Look(beside, channel, size, factor, window)
        look.tried = pattern.tried
        best = look.best()
        if best is not None and (k not in doubtful or best.worth > 0.0):
            found[k] = look.edges_of(best)
            columns[:, k] = look.column_of(found[k])
    found = [edges for edges, column in zip(found, columns.T, strict=True) if column.any()]
    return _pattern(pattern.family, pattern.variables, found, clock, factor, pattern.tried)


def _shares_an_edge(found: Sequence[tuple[float, float]], k: int) -> bool:
    own = np.array(found[k])
    return any(
        np.ptp(own) < np.ptp(other) and np.abs(own[:, None] - np.array(other)).min() <= 1.0
        for j, other in enumerate(found)
        if j != k
    )


def _pattern(
    family: Family,
    over: tuple[Variable, ...],
    found: Sequence[tuple[float, float]],
    clock: Clock,
    factor: Floats,
    tried: float,
) -> Pattern:
    form = Stretches(tuple(a for a, _ in found), tuple(b for _, b in found), clock.response)
    width = len(found)
    # A pattern of k stretches is one of tried**k / k! [k places in any order].
    sizes = sorted({1, 2, 3, 4, 6, 9, 13, 19, 28, width} & set(range(1, width + 1)))
    choices = tuple(
        (tuple(range(k)), float(gammaln(k + 1) - (k - 1) * np.log(tried) - np.log(len(sizes))), f"{k} of them")
        for k in sizes
    )
    samples = form.columns(clock.rows) * factor[:, None]
    return Pattern.plain(family, over, samples, form, _label(found), tried, choices if width > 1 else ())


def _label(found: Sequence[tuple[float, float]]) -> str:
    first, last = found[0]
    begins, ends = (f"{edge:.6g}" if np.isfinite(edge) else "the end" for edge in (np.ceil(first), np.ceil(last) - 1.0))
    begins = "0" if np.isneginf(first) else begins
    return f"rows {begins} to {ends}" + (f" and {len(found) - 1} more" if len(found) > 1 else "")


class _Look:
    """Search for the best window by cumulative sums: first by bins, then by rows at both ends."""

    def __init__(
        self, left: Left, channel: Channel, size: float, factor: Floats, windows: Integers | None = None
    ) -> None:
        kept, factor = channel.kept, factor[channel.kept]
        self._left, self._size, self._clock, self._factor = left, size, channel.row_clock, factor
        self._rows, self._at = np.flatnonzero(kept), self._clock.rows[kept]
        ends = np.searchsorted(self._rows, [[b.start, b.stop] for b in channel.blocks])
        self._blocks = [(int(a), int(b)) for a, b in ends if b - a >= 2 * SHORTEST]
        self._whole = _cumulative(left.whitened(factor) ** 2)
        self._edges = _squares_of_edges(left.coloured, len(self._rows))
        self._along_axes = _cumulative(np.asfortranarray(factor[:, None] * left.beside))
        self._lengths = _squares(self._along_axes)
        self._total = _cumulative(factor * left.towards)
        self._windows = self._all_windows() if windows is None else windows
        self._own = self._information(self._windows[:, 0], self._windows[:, 1])
        self.tried = max(float(len(self._windows)) / INDEPENDENT, 1.0)

    def _all_windows(self) -> Integers:
        per = max(1, int(np.ceil(len(self._rows) / BOUNDS.pieces_of_time)))
        found = [np.zeros((0, 2), dtype=np.int64)]
        for first, last in self._blocks:
            many = (last - first) // per
            octaves = int(np.log2(max(many, 1)) * BOUNDS.lengths_per_octave) + 1
            lengths = np.unique(np.round(2.0 ** (np.arange(octaves) / BOUNDS.lengths_per_octave)).astype(np.int64))
            for length in lengths[(lengths * per >= SHORTEST) & (lengths < many)]:
                begin = np.arange(0, many - length + 1, max(1, int(length) // 8)) * per + first
                found.append(np.column_stack([begin, begin + length * per]))
            # Windows to the end of the block or of all rows are steps.
            begin = np.arange(first, last - SHORTEST + 1, per)
            found += [np.column_stack([begin, np.full(len(begin), end)]) for end in (last, len(self._rows))]
        # Encoding each pair as one number makes sorting fast.
        per_row = len(self._rows) + 1
        starts, ends = np.divmod(np.unique(np.vstack(found) @ np.array([per_row, 1])), per_row)
        return np.column_stack([starts, ends])[ends - starts < len(self._rows)]

    def _information(self, starts: Integers, ends: Integers) -> Floats:
        own, along = self._whole[ends] - self._whole[starts] + self._edges[ends - starts], self._along_axes
        for many in range(0, len(starts), BOUNDS.stretches_at_once):
            rows = slice(many, many + BOUNDS.stretches_at_once)
            own[rows] -= _squares(along[ends[rows]] - along[starts[rows]])
        return own

    def best(self) -> _Window | None:
        """Return the best window with refined ends."""
        if not len(self._windows):
            return None
        along = self._total[self._windows[:, 1]] - self._total[self._windows[:, 0]]
        first, last = (int(edge) for edge in self._windows[int(self._worth(along, self._own).argmax())])
        sought = None
        for _ in range(BOUNDS.ends_moved):
            low, high = self._within(first, last)
            if high - low < SHORTEST:
                return None
            first = min(first, high - SHORTEST)
            last = first + SHORTEST + int(self._worth_between(first, slice(first + SHORTEST, high + 1)).argmax())
            if sought == (low, high, last):
                break  # its beginning is already optimal for this end
            first = low + int(self._worth_between(last, slice(low, last - SHORTEST + 1)).argmax())
            sought = low, high, last
        return _Window(first, last, float(self._worth_between(first, slice(last, last + 1))[0]))

    def _within(self, first: int, last: int) -> tuple[int, int]:
        for low, high in self._blocks:
            if low <= first and last <= high:
                return low, high
        return 0, len(self._rows)

    def _worth_between(self, edge: int, others: slice) -> Floats:
        way, along = 1.0 if others.start > edge else -1.0, self._along_axes
        own = way * (self._whole[others] - self._whole[edge])
        own += self._edges[np.abs(np.arange(others.start, others.stop) - edge)]
        own -= self._lengths[others] - 2.0 * (along[others] @ along[edge]) + self._lengths[edge]
        return self._worth(self._total[others] - self._total[edge], own)

    def _worth(self, along: Floats, own: Floats) -> Floats:
        information = np.maximum(own, 0.0) + 1.0 / self._size**2
        occam = 0.5 * np.log(information * self._size**2)
        return 0.5 * along**2 / information - occam - np.log(self.tried)

    def edges_of(self, window: _Window) -> tuple[float, float]:
        """Return a stretch's edges in rows."""
        first, last = window.first, window.last
        begins = float(0.5 * (self._at[first - 1] + self._at[first])) if first > 0 else -np.inf
        ends = float(0.5 * (self._at[last - 1] + self._at[last])) if last < len(self._at) else np.inf
        for finer in FINER:
            moves = np.arange(-4.0, 5.0) * finer
            # The edges must enclose at least the shortest stretch.
            begins, _ = self._best_edges(np.minimum(begins + moves, ends - SHORTEST), np.full(len(moves), ends))
            _, ends = self._best_edges(np.full(len(moves), begins), np.maximum(ends + moves, begins + SHORTEST))
        return begins, ends

    def column_of(self, edges: tuple[float, float]) -> Floats:
        """Return a stretch's whitened column, shape (n,)."""
        return self._left.whitened(self._columns(*np.array(edges)[:, None]))[:, 0]

    def take(self, window: _Window) -> tuple[float, float]:
        """Add a stretch and return its edges in rows."""
        begins, ends = self.edges_of(window)
        column = self.column_of((begins, ends))[:, None]
        self._left = self._left.also(column, np.array([self._size * self._left.noise]))
        self._total = _cumulative(self._factor * self._left.towards)
        total = _cumulative(self._factor * self._left.transposed(self._left.axes[:, -1]))
        self._along_axes = np.column_stack([self._along_axes, total])
        self._lengths = self._lengths + total**2
        self._own = self._own - (total[self._windows[:, 1]] - total[self._windows[:, 0]]) ** 2
        return begins, ends

    def _best_edges(self, begins: Floats, ends: Floats) -> tuple[float, float]:
        # Stretches differ only about the moving edge, so their common part is whitened and multiplied once, within its
        # support.
        rings, reach = self._left.coloured.order, self._clock.reach
        moving = begins if begins[0] < begins[-1] else ends
        here = self._within_times(begins[0] - reach, ends[-1] + reach)
        about = self._within_times(moving[0] - reach, moving[-1] + reach) if moving[0] < moving[-1] else slice(0, 0)
        there = slice(here.start, min(here.stop + rings, len(self._at)))
        one = self._left.whitened_part(self._columns(begins[:1], ends[:1], here), here, there)
        columns = self._columns(begins, ends, about)
        columns = columns - columns[:, :1]
        near = slice(about.start, min(about.stop + rings, len(self._at)) if len(columns) else about.start)
        away = self._left.whitened_part(columns, about, near)
        axes, inside = self._left.axes, slice(near.start - there.start, near.stop - there.start)
        along = one.T @ self._left.rest[there] + away.T @ self._left.rest[near]
        taken = axes[there].T @ one + axes[near].T @ away
        own = np.sum(one**2) + np.sum(away**2, axis=0) - np.sum(taken**2, axis=0)
        if len(away):
            own += 2.0 * (one[inside].T @ away)[0]
        explained = along**2 / (np.maximum(own, 0.0) + 1.0 / self._size**2)
        order = np.argsort(np.abs(np.arange(len(begins)) - len(begins) // 2), kind="stable")
        k = int(order[int(np.argmax(explained[order] * (1.0 - ALIKE * np.arange(len(order)))))])
        return float(begins[k]), float(ends[k])

    def _within_times(self, first: float, last: float) -> slice:
        begin, end = np.searchsorted(self._at, [first, last + 1.0]).tolist()
        return slice(begin, end)

    def _columns(self, begins: Floats, ends: Floats, rows: slice = slice(None)) -> Floats:
        at = self._at[rows, None]
        return (self._clock.response(at - begins) - self._clock.response(at - ends)) * self._factor[rows, None]


INDEPENDENT = 4.0
"""Number of similar windows that count as one trial."""

FINER = (0.25, 0.25, 0.06, 0.06, 0.015)
"""Successive steps of edge refinement, in rows: an edge of a hundred times the noise is determined to a hundredth of a row."""

ALIKE = 1e-12
"""Negligible relative difference."""


def _squares(rows: Floats) -> Floats:
    return np.einsum("wk,wk->w", rows, rows)


def _cumulative(rows: Floats) -> Floats:
    found = np.zeros((len(rows) + 1, *rows.shape[1:]), order="F")
    np.cumsum(rows, axis=0, out=found[1:])
    return found


def _squares_of_edges(noise: Coloured, longest: int) -> Floats:
    """Return squares of both whitened edges, for stretch lengths 0 to `longest`."""
    taps = noise.filter
    step = np.concatenate([np.cumsum(taps), np.full(longest, taps.sum())])
    inside = np.concatenate([[0.0], np.cumsum(step[:longest] ** 2 - taps.sum() ** 2)])
    reach = min(len(taps), longest)  # constant for longer stretches
    near = [np.sum((step[k : k + len(taps)] - step[: len(taps)]) ** 2) for k in range(reach + 1)]
    behind = np.pad(near, (0, longest - reach), mode="edge")
    return inside + behind
