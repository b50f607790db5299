"""Held-out error of the complete selection, the gain of each effect, and uncertainty by omitting each block.

For each part the set is selected from all causes by the other parts; nonlinear parameters stay within half a grid step.
The set, refitted with and without each effect, then predicts the part. The score is the log density [Good, J. R. Stat.
Soc. B 14 (1952) 107], the part's contribution to the log evidence. The same comparisons give selection frequencies
without some tests.

The jackknife includes correlated and uneven noise without a noise model. [Tukey 1958; by groups in Künsch, Annals of
Statistics 17 (1989) 1217, sec. 2]
"""

from __future__ import annotations

from collections.abc import Mapping  # noqa: TC003 - types of fields are read when results are written
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np

from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.followed import (
    ClassGain,
    VariableProbabilities,
    WithoutPart,
    classes_of,
    follow_of,
)
from dbbstation.inference.hypotheses import search
from dbbstation.inference.levels import DensityGains, Gains, is_worse
from dbbstation.inference.square_root import Block, Columns, Solution, compress, solve, spread
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison
    from dbbstation.inference.settle import Settled


@dataclass(frozen=True)
class HeldOut:
    """Prediction errors of omitted measurements.

    Attributes:
        rms: with the omitted blocks' random effects fitted under priors, in the channel's unit.
        normalised: root of chi-square by predicted covariance per degree of freedom; near 1 if correct.
    """

    rms: float
    normalised: float


def errors_without(
    blocks: Sequence[Block],
    tests: Sequence[str],
    known: Columns,
    widths: Mapping[str, int],
    noise: float,
    held: Floats,
    single: float | None = None,
) -> Callable[[Collection[str]], HeldOut]:
    """Return a function that omits groups of tests in turn and predicts them without some causes.

    Args:
        tests: of each block.
        known: of the columns of the base, then of causes.
        widths: number of each cause's columns, which the kept blocks alone determine.
        noise: white noise of equal low-frequency power.
        held: directions of the base's fitted columns held at zero, in scaled columns.
        single: noise of a single measurement, if smaller than `noise`; else None.
    """
    groups, base = in_turn(tests, BOUNDS.folds_of_an_error), len(known.prior) - sum(widths.values())
    owner = np.repeat(["", *widths], [base, *widths.values()])

    def without(names: Collection[str]) -> HeldOut:
        active = np.flatnonzero(~np.isin(owner, list(names)))
        used = Columns(known.prior[active], known.scale[active], known.random[active] & (active < base))
        wide = np.hstack([held, np.zeros((len(held), len(active) - base))])
        thin = [_restricted(block, active) for block in blocks]
        square, count, weighted, rows = 0.0, 0, 0.0, 0
        for group in sorted(set(groups)):
            kept = [b for b, g in zip(thin, groups, strict=True) if g != group]
            out = [b for b, g in zip(thin, groups, strict=True) if g == group]
            fitted = solve(kept, used, noise, wide)
            square += _left(out, used, fitted.x, noise)
            count += sum(block.count for block in out)
            inside, degrees = _weighted(out, fitted, noise if single is None else single)
            weighted += inside
            rows += degrees
        return HeldOut(float(np.sqrt(square / count)), float(np.sqrt(weighted / max(rows, 1))))

    return without


def _restricted(block: Block, active: Integers) -> Block:
    inside = np.isin(block.columns, active)
    columns = np.searchsorted(active, block.columns[inside])
    return Block(columns, block.triangle[:, inside], block.target, block.count, block.square)


def _weighted(blocks: Sequence[Block], fitted: Solution, noise: float) -> tuple[float, int]:
    # The last row of a triangular factor contains the norm outside all columns, not the noise of one measurement.
    cut = [Block(b.columns, b.triangle[:-1], b.target[:-1], b.count, b.square) for b in blocks]
    whole, target = np.hsplit(spread(cut, len(fitted.x)), [-1])
    remaining = (target[:, 0] - whole @ fitted.x) / noise
    variance, axes = np.linalg.eigh(fitted.covariance)
    uncertain = whole @ (axes * np.sqrt(np.maximum(variance, 0.0))) / noise
    towards = uncertain.T @ remaining
    explained = towards @ np.linalg.solve(np.eye(len(towards)) + uncertain.T @ uncertain, towards)
    return float(remaining @ remaining - explained), len(remaining)


def _left(blocks: Sequence[Block], known: Columns, x: Floats, noise: float) -> float:
    random = np.flatnonzero(known.random)
    whole, target = np.hsplit(spread(blocks, len(known.prior)), [-1])
    fixed = x.copy()
    fixed[random] = 0.0
    remaining = target[:, 0] - whole @ fixed
    stacked = np.vstack([whole[:, random] / noise, np.diag(1.0 / known.prior[random])])
    effects, *_ = np.linalg.lstsq(stacked, np.concatenate([remaining / noise, np.zeros(len(random))]), rcond=None)
    remaining = remaining - whole[:, random] @ effects
    # The targets' part outside all columns remains in every fit.
    beyond = sum(block.square - float(block.target @ block.target) for block in blocks)
    return float(remaining @ remaining) + max(beyond, 0.0)


ENOUGH_BLOCKS = 5
"""Number of blocks from which parts are whole blocks, if these have similar sizes."""

WIDEST_GAP = 0.5
"""Largest excluded gap on each side of a part, over its rows: even for long correlations four fifths of the rows remain
for the selection."""


Kind: TypeAlias = "tuple[str, ...]"
"""Family and variables of an effect, or the name of a law."""


def numbered(names: Sequence[str]) -> list[int]:
    """Return each name's number by first appearance."""
    order = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return [order[name] for name in names]


def in_turn(names: Sequence[str], most: int) -> list[int]:
    """Return each run's group; tests are distributed cyclically, and each test is in one group."""
    tests = numbered(names)
    return [test % min(most, max(tests) + 1) for test in tests]


@dataclass(frozen=True)
class Fold:
    """Results for one held-out part.

    Attributes:
        as_simulated: rms error of the reference, in the residual's unit.
        before: rms error of the base, refitted by ordinary least squares.
        gains: gain of each kind, as decrease of squared error; for a simulator, increase of log density.
    """

    name: str
    rows: int
    as_simulated: float
    before: float
    after: float
    gains: Annotated[Mapping[Kind, float], AsItIs, Kept] = field(default_factory=dict)


@dataclass(frozen=True)
class HeldOutError:
    """Prediction errors of held-out rows."""

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
        """Return the selection's error over all parts."""
        return self._all([fold.after for fold in self.folds])

    def corrected(self, after: Sequence[float]) -> HeldOutError:
        """Return a copy in which each part has this error after correction."""
        return replace(self, folds=tuple(replace(fold, after=one) for fold, one in zip(self.folds, after, strict=True)))

    @property
    def is_worse(self) -> bool:
        """Return whether the selection predicts worse than the reference."""
        return is_worse(self.after, self.as_simulated)

    def gains_of(self, kinds: Collection[Kind]) -> Gains:
        """Return the summed gain of several kinds in each part; zero for unselected kinds."""
        parts = tuple(sum(fold.gains.get(kind, 0.0) for kind in set(kinds)) for fold in self.folds)
        return Gains(parts, tuple(fold.rows for fold in self.folds))

    def _all(self, errors: list[float]) -> float:
        counts = np.array([fold.rows for fold in self.folds], dtype=np.float64)
        return float(np.sqrt(np.sum(counts * np.square(errors)) / counts.sum()))


def selections_without(
    channel: Channel,
    choose: Callable[[Channel], Settled],
    progress: Callable[[str, int, int], None] = lambda _text, _done, _of: None,
    *,
    alike: float = 1.0,
) -> list[WithoutPart]:
    """Repeat the selection without each part [`part_numbers`] and without rows correlated with it.

    Args:
        choose: the complete selection.
        alike: correlation time of noise [rows].
    """
    found, parts = [], parts_of(channel)
    for done, (name, rows) in enumerate(parts):
        progress("held-out part", done, len(parts))
        settled = choose(channel.without(rows | beside(channel, rows, alike)))
        found.append(WithoutPart(rows, settled, name))
    return found


def held_out_error(
    channel: Channel, parts: Sequence[WithoutPart], reference: Callable[[Flags], Floats] | None = None
) -> HeldOutError:
    """Predict each part by the selection without it; the reference may use all rows of the other parts.

    Args:
        reference: function from allowed rows, shape (n,), to a prediction of all rows, shape (n,); None for their mean.
    """
    found, residual = [], channel.residual
    for part in parts:
        rows = part.rows
        plain = float(np.mean(residual[~rows])) if reference is None else reference(~rows)
        refitted = residual - channel.base.samples @ channel.without(rows).refitted()
        one, two, three = (rms(left[rows]) for left in (residual - plain, refitted, part.settled.left))
        found.append(Fold(part.name, int(rows.sum()), one, two, three, _gains(part)))
    return HeldOutError(tuple(found))


def _gains(part: WithoutPart) -> dict[Kind, float]:
    (_, with_all), found = part.predicted(), dict[Kind, float]()
    for name in (member.name for member in part.settled.best.members):
        kind = part.settled.bank.kind_of(name)
        found[kind] = found.get(kind, 0.0) + part.predicted([name])[1] - with_all
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
    """Return parts with their names; rows have shape (n,)."""
    number = part_numbers([block.stop - block.start for block in channel.blocks])
    found = []
    for k in range(int(number.max()) + 1):
        rows = number == k
        ends = np.flatnonzero(rows)
        found.append((f"rows {ends[0] + 1} to {ends[-1] + 1}", rows))
    return found


def part_numbers(lengths: Sequence[int]) -> Integers:
    """Return the number of each row's part, shape (n,); parts have similar size and whole blocks."""
    # Long blocks are split evenly. Short neighbouring blocks are joined, to at most `BOUNDS.folds` parts of at least half an
    # equal share.
    share = sum(lengths) / (min(BOUNDS.folds, len(lengths)) if len(lengths) >= ENOUGH_BLOCKS else BOUNDS.folds)
    sizes: list[int] = []
    for length in lengths:
        pieces = max(min(round(length / share), length), 1)
        sizes += np.diff(np.arange(pieces + 1) * length // pieces).tolist()
    while len(sizes) > 1 and (len(sizes) > BOUNDS.folds or min(sizes) < 0.5 * share):
        short = range(len(sizes) - 1) if len(sizes) > BOUNDS.folds else _beside(int(np.argmin(sizes)), len(sizes))
        k = min(short, key=lambda k: sizes[k] + sizes[k + 1])
        sizes[k : k + 2] = [sizes[k] + sizes[k + 1]]
    return np.repeat(np.arange(len(sizes)), sizes)


def _beside(k: int, count: int) -> list[int]:
    return [first for first in (k - 1, k) if 0 <= first < count - 1]


def weighted_jackknife(
    values: Floats,
    variances: Floats,
    without: Floats,
    variances_without: Floats,
) -> Floats:
    """Return jackknife standard uncertainties, shape (p,), weighted by remaining information.

    Args:
        without: values fitted without each part, shape (k, p).
        variances_without: their stated variances, shape (k, p); infinite if a part alone determines the value.
    """
    # If the stated variance is correct, it equals the expected square [weighted jackknife, Wu, Annals of Statistics 14
    # (1986) 1261, eq. 5.1, by value].
    with np.errstate(all="ignore"):
        squares = variances / variances_without * np.square(without - values)
    return np.sqrt(np.sum(np.where(np.isfinite(squares), squares, 0.0), axis=0))


def widening(variances: Floats, moved: Floats, variances_without: Floats) -> Floats:
    """Return factors, shape (p,), from the model's uncertainty to the larger of model and jackknife uncertainty.

    Values of one weak direction have similar factors, so scaled covariances keep combinations. Held values keep factor 1.

    Args:
        variances: shape (p,).
        moved: changes of values without each part, shape (k, p).
        variances_without: shape (k, p).
    """
    found = weighted_jackknife(np.zeros(len(variances)), variances, moved, variances_without)
    return np.maximum(found / np.sqrt(np.where(variances > 0.0, variances, np.inf)), 1.0)


def refits_without(settled: Settled, parts: Sequence[Flags]) -> tuple[Solution, ...]:
    """Refit base and best members without each part, with unchanged selection."""
    bank, channel = settled.bank, settled.channel
    columns, known = bank.jointly(settled.best.members)
    numbers, target = np.arange(columns.shape[1]), bank.target
    blocks = [compress(numbers, columns[rows[channel.kept]], target[rows[channel.kept]]) for rows in parts]
    with np.errstate(all="ignore"):
        return tuple(
            solve([*blocks[:k], *blocks[k + 1 :]], known, settled.noise.innovation, channel.held)
            for k in range(len(blocks))
        )


LEAST_PARTS = 4
"""Fewest parts for a gain without the best part and for a scatter."""

Gained: TypeAlias = "dict[Kind | frozenset[str], float]"
"""Gains of log density in a part, by kind of effect or by variables of a class; the empty set is for all effects."""


@dataclass(frozen=True, eq=False)
class KnownGains:
    """Held-out gains computed for each selected effect and a fixed list of classes.

    Attributes:
        rows: of each part, shape (n,).
        before: rms error of all parts without each class.
        after: rms error of all parts with all effects.
    """

    rows: Sequence[Flags]
    parts: Sequence[Gained]
    before: Mapping[frozenset[str], float]
    after: float

    def of(self, wanted: Collection[str] | None) -> ClassGain:
        """Return the gain of a class by its variables, None for all effects; zero if unknown."""
        key = frozenset(wanted or ())
        if key not in self.before:
            return ClassGain(DensityGains(()), 0.0, 0.0)
        return ClassGain(self._gains({key}), self.before[key], self.after)

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """Return the summed gain of several kinds in each part; zero for unselected kinds."""
        return self._gains(set(kinds))

    @property
    def is_worse(self) -> bool:
        """Return whether the selections predict worse than the base."""
        return self.of(None).gains.total < 0.0

    def but_for(self, _ignored: Collection[str]) -> KnownGains:
        """Return unchanged gains, because events in tests are random effects here and simulator terms do not follow time."""
        return self

    def errors_with(self, _wanted: Collection[str]) -> list[float]:
        """Return the rms errors with all effects, because they are applied together."""
        return [self.after] * len(self.rows)

    def _gains(self, keys: Collection[Kind | frozenset[str]]) -> DensityGains:
        gains = tuple(sum(part.get(key, 0.0) for key in keys) for part in self.parts)
        return DensityGains(gains, tuple(int(rows.sum()) for rows in self.rows))


def groups_of_tests(tests: Sequence[str]) -> list[int]:
    """Return each run's group of tests, by the runs' tests; empty for fewer than `LEAST_PARTS` groups."""
    groups = in_turn(tests, BOUNDS.folds)
    return groups if len(set(groups)) >= LEAST_PARTS else []


def rows_of_groups(groups: Sequence[int], blocks: Sequence[slice]) -> list[Flags]:
    """Return the rows of each group of blocks, shape (n,)."""
    lengths = [block.stop - block.start for block in blocks]
    return [np.repeat(np.array(groups) == group, lengths) for group in sorted(set(groups))]


def gains_of_tests(
    settled: Settled,
    rows: Sequence[Flags],
    errors: Callable[[], Callable[[Collection[str]], HeldOut]],
    asked: Callable[[Cause], bool] = lambda _: True,
    **limits: Any,  # noqa: ANN401 - as of `search`
) -> KnownGains | None:
    """Return gains of causes and classes in groups of tests; None without groups or causes.

    Args:
        rows: of each group, shape (n,).
        errors: function that returns `errors_without` for this outcome.
        limits: options of the searches without a group.
    """
    if not rows or not settled.best.members:
        return None

    def choose(comparison: ModelComparison) -> Sequence[Member]:
        return search(comparison, settled.causes, [settled.best.members], **limits).best.members

    # Omit columns of earlier layouts, which no cause uses.
    used = columns_of(settled.causes)
    comparisons = settled.comparison, (settled.bank.without(out, used) for out in rows)
    follow = follow_of(settled)
    classes = [one.wanted for one in classes_of(settled, VariableProbabilities(settled))]
    parts = chosen_anew(*comparisons, choose, settled.bank.kind_of, asked, classes, follow)
    names, without = settled.best.names, errors()
    before = {one: without([name for name in names if follow(name) & one]).rms for one in classes}
    return KnownGains(rows, parts, {frozenset(): without(names).rms, **before}, without(()).rms)


SHARE = 0.7
"""Share of the groups of tests in each draw."""


def selection_frequency(
    groups: Sequence[int],
    causes: Sequence[Cause],
    without: Callable[[Flags], ModelComparison],
    rng: np.random.Generator,
    begin: Sequence[Member] = (),
    most_members: int | None = None,
) -> dict[str, float]:
    """Return how often each cause is selected.

    Args:
        groups: number of each run's group.
        without: function from omitted runs, shape (r,), to a comparison.
    """
    # Each draw keeps seven tenths of the groups without replacement, because repeated groups look certain [Meinshausen
    # and Bühlmann, J. R. Stat. Soc. B 72 (2010) 417, sec. 2, draw halves]. Groups, such as tests, are kept together.
    names = np.array(sorted(set(groups)))
    kept_groups = max(int(np.ceil(SHARE * len(names))), min(len(names), 2))
    times = dict.fromkeys((cause.name for cause in causes), 0)
    for _ in range(BOUNDS.selection_draws):
        comparison = without(~np.isin(groups, rng.choice(names, kept_groups, replace=False)))
        found = search(comparison, causes, [begin], most_members=most_members, likely=BOUNDS.close, thorough=not begin)
        for name in found.best.names:
            times[name] += 1
    return {name: count / BOUNDS.selection_draws for name, count in times.items()}


def columns_of(causes: Iterable[Cause]) -> Integers:
    """Return all columns of causes, ascending."""
    variants = (variant for cause in causes for variant in cause.variants)
    return np.unique(np.concatenate([part for one in variants for part in (one.columns, one.slack)]))


def chosen_anew(
    of_all: ModelComparison,
    of_others: Iterable[ModelComparison],
    choose: Callable[[ModelComparison], Sequence[Member]],
    kind_of: Callable[[str], Kind],
    asked: Callable[[Cause], bool] = lambda _: True,
    classes: Sequence[frozenset[str]] = (),
    follow: Callable[[str], frozenset[str]] = lambda _: frozenset(),
) -> list[Gained]:
    """Select causes without each part, and return their gains in this part.

    Args:
        choose: function from a comparison to its most probable members, starting from all rows' selection.
        kind_of: function from a cause to its kind.
        asked: function that selects causes whose own gain is wanted.
        classes: variables of classes, whose effects are omitted together.
        follow: function from a cause to followed variables.
    """
    parts = []
    for others in of_others:
        chosen = choose(others)
        whole = _predicted(of_all, others, chosen)
        found: Gained = {frozenset[str](): whole}
        for name in (member.name for member in chosen if asked(member.cause)):
            less = [m for m in chosen if m.name != name]
            found[kind_of(name)] = found.get(kind_of(name), 0.0) + whole - _predicted(of_all, others, less)
        for wanted in classes:
            less = [m for m in chosen if not follow(m.name) & wanted]
            found[wanted] = whole - _predicted(of_all, others, less) if len(less) < len(chosen) else 0.0
        parts.append(found)
        del others  # free the products before the next part needs as much memory
    return parts


def _predicted(of_all: ModelComparison, of_others: ModelComparison, members: Sequence[Member]) -> float:
    return of_all.log_evidence(members) - of_others.log_evidence(members)
