"""Held-out error of a complete selection, and each effect's gain."""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - types of fields are read when results are written
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, TypeAlias

import numpy as np

from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.inference.followed import left_without
from dbbstation.inference.triangle import rms
from dbbstation.inference.verdict import Gains, is_worse

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.settled import Settled

FOLDS = 10
"""Parts that are held back in turn, at the most; as many where there are fewer than `ENOUGH_BLOCKS` blocks."""

ENOUGH_BLOCKS = 5
"""Blocks from which on there are no more parts than blocks, so that blocks of like size are held back whole."""

WIDEST_GAP = 0.5
"""Gap beside a part at the most, as a share of its rows: where neighbours resemble each other for longer, four fifths of the rows are
still left to choose from."""

FOLDS_OF_AN_ERROR = 5
"""Groups of tests that are left out in turn where only the error of the prediction is asked for, nothing being chosen anew."""

Kind: TypeAlias = "tuple[str, ...]"
"""Family and variables of an effect, or the name of a law."""


def numbered(names: Sequence[str]) -> list[int]:
    """Return each name's number by first appearance."""
    order = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return [order[name] for name in names]


def in_turn(names: Sequence[str], most: int) -> list[int]:
    """Return each run's group by test, tests in turn; at most one group per test."""
    tests = numbered(names)
    return [test % min(most, max(tests) + 1) for test in tests]


@dataclass(frozen=True)
class Fold:
    """One held-back part.

    Attributes:
        as_simulated: rms error of the reference, in the residual's unit.
        before: base refitted by ordinary least squares.
        gains: by kind, squared error without minus with; for a simulator, log density with minus without.
    """

    name: str
    rows: int
    as_simulated: float
    before: float
    after: float
    gains: Annotated[Mapping[Kind, float], AsItIs, Kept] = field(default_factory=dict)


@dataclass(frozen=True)
class HeldOutError:
    """Errors of rows that took no part."""

    folds: tuple[Fold, ...]

    @property
    def as_simulated(self) -> float:
        """Return the reference's error over all parts."""
        return self._all([fold.as_simulated for fold in self.folds])

    @property
    def before(self) -> float:
        """Return the refitted base's error over all parts."""
        return self._all([fold.before for fold in self.folds])

    @property
    def after(self) -> float:
        """Return the choice's error over all parts."""
        return self._all([fold.after for fold in self.folds])

    def corrected(self, after: Sequence[float]) -> HeldOutError:
        """Return the same with other errors of the corrected parts."""
        return replace(self, folds=tuple(replace(fold, after=one) for fold, one in zip(self.folds, after, strict=True)))

    @property
    def is_worse(self) -> bool:
        """Return whether the choice predicts worse than the reference."""
        return is_worse(self.after, self.as_simulated)

    def gains_of(self, kinds: Collection[Kind]) -> Gains:
        """Return the joint gain of kinds per part; empty if never chosen."""
        parts = tuple(sum(fold.gains.get(kind, 0.0) for kind in set(kinds)) for fold in self.folds)
        return Gains(parts, tuple(fold.rows for fold in self.folds))

    def _all(self, errors: list[float]) -> float:
        counts = np.array([fold.rows for fold in self.folds], dtype=np.float64)
        return float(np.sqrt(np.sum(counts * np.square(errors)) / counts.sum()))


def held_out_error(
    channel: Channel,
    choose_without: Callable[[Channel, Flags], Settled],
    progress: Callable[[str, int, int], None] = lambda _text, _done, _of: None,
    *,
    alike: float = 1.0,
    reference: Callable[[Flags], Floats] | None = None,
) -> HeldOutError:
    """Hold back parts in turn [`part_numbers`].

    Rows that resemble a held-back stretch are excluded from the choice, not from the reference.

    Args:
        choose_without: full selection without rows, shape (n,).
        alike: correlation time of noise [rows].
        reference: prediction over all rows, shape (n,), from allowed rows, shape (n,); None: their mean.
    """
    found = []
    parts = parts_of(channel)
    for done, (name, rows) in enumerate(parts):
        progress("held-out part", done, len(parts))
        out = rows | beside(channel, rows, alike)
        settled = choose_without(channel, out)
        plain = float(np.mean(channel.residual[~rows])) if reference is None else reference(~rows)
        refitted = channel.residual - channel.base.samples @ channel.without(rows).refitted()
        corrected = channel.residual - settled.predicted()
        one, two, three = (rms(errors[rows]) for errors in (channel.residual - plain, refitted, corrected))
        found.append(Fold(name, int(rows.sum()), one, two, three, _gains(settled, rows)))
    return HeldOutError(tuple(found))


def _gains(settled: Settled, rows: Flags) -> dict[Kind, float]:
    with_all = float(np.sum(np.square(left_without(settled, ())[rows])))
    found: dict[Kind, float] = {}
    for member in settled.best.members:
        kind, error = settled.bank.kind_of(member.cause.name), left_without(settled, [member.cause.name])
        found[kind] = found.get(kind, 0.0) + float(np.sum(np.square(error[rows]))) - with_all
    return found


def beside(channel: Channel, rows: Flags, alike: float) -> Flags:
    """Return rows of a block within a correlation time of a part, shape (n,)."""
    found = np.zeros(len(rows), dtype=bool)
    gap = min(int(np.ceil(alike)), int(WIDEST_GAP * rows.sum())) if channel.time is not None and alike > 1.0 else 0
    for block in channel.blocks:
        own = np.flatnonzero(rows[block])
        if gap and len(own):
            found[block.start + max(own[0] - gap, 0) : min(block.start + own[-1] + 1 + gap, block.stop)] = True
    return found & ~rows


def parts_of(channel: Channel) -> list[tuple[str, Flags]]:
    """Return named parts to hold back: rows, shape (n,)."""
    number = part_numbers([block.stop - block.start for block in channel.blocks])
    found = []
    for k in range(int(number.max()) + 1):
        rows = number == k
        ends = np.flatnonzero(rows)
        found.append((f"rows {ends[0] + 1} to {ends[-1] + 1}", rows))
    return found


def part_numbers(lengths: Sequence[int]) -> Integers:
    """Return each row's part, parts of similar size and whole blocks, shape (n,).

    Long blocks are split evenly; short neighbours are joined to at most `FOLDS` parts of at least half an even share.
    """
    share = sum(lengths) / (min(FOLDS, len(lengths)) if len(lengths) >= ENOUGH_BLOCKS else FOLDS)
    sizes: list[int] = []
    for length in lengths:
        pieces = max(min(round(length / share), length), 1)
        sizes += np.diff(np.arange(pieces + 1) * length // pieces).tolist()
    while len(sizes) > 1 and (len(sizes) > FOLDS or min(sizes) < 0.5 * share):
        short = range(len(sizes) - 1) if len(sizes) > FOLDS else _beside(int(np.argmin(sizes)), len(sizes))
        k = min(short, key=lambda k: sizes[k] + sizes[k + 1])
        sizes[k : k + 2] = [sizes[k] + sizes[k + 1]]
    return np.repeat(np.arange(len(sizes)), sizes)


def _beside(k: int, count: int) -> list[int]:
    return [first for first in (k - 1, k) if 0 <= first < count - 1]
