"""Gain of each effect in held-out parts, by predictive density.

For each part the set is selected from all causes by the other parts; nonlinear parameters stay within half a grid step.
The set, refitted with and without each effect, then predicts the part. The score is the log density [Good, J. R. Stat.
Soc. B 14 (1952) 107], the part's contribution to the log evidence. The same comparisons give selection frequencies
without some tests.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.folds import in_turn
from dbbstation.inference.followed import ClassGain, VariableProbabilities, classes_of, follow_of
from dbbstation.inference.hypotheses import search
from dbbstation.inference.verdict import DensityGains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Integers
    from dbbstation.inference.folds import Kind
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison
    from dbbstation.inference.settled import Settled

Classes: TypeAlias = "tuple[Sequence[frozenset[str]], Callable[[str], frozenset[str]]]"
"""Classes of variables, and a function from causes to followed variables."""

LEAST_PARTS = 4
"""Fewest parts for a gain without the best part and for a scatter."""


@dataclass(frozen=True, eq=False)
class ChosenAnew:
    """Log density gains in held-out parts.

    Attributes:
        brought: per part, the gain by each selected kind of effect.
        whole: per part, the gain of all effects over the base.
        of_classes: per part, the gain by each class of variables.
    """

    brought: tuple[dict[Kind, float], ...]
    whole: tuple[float, ...]
    of_classes: tuple[Mapping[frozenset[str], float], ...] = ()

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """Return the summed gain of several kinds in each part; zero for unselected kinds."""
        return DensityGains(tuple(sum(part.get(kind, 0.0) for kind in set(kinds)) for part in self.brought))

    @property
    def is_worse(self) -> bool:
        """Return whether the selection predicts worse than the base."""
        return sum(self.whole) < 0.0


@dataclass(frozen=True, eq=False)
class KnownGains:
    """Held-out gains computed for a fixed list of classes.

    Attributes:
        rows: of each part, shape (n,).
        gains: gain of each class by its variables; the empty set is for all effects.
        errors: rms error of each part with all effects.
        anew: gains by the selections without each part; None if unknown.
    """

    rows: Sequence[Flags]
    gains: Mapping[frozenset[str], ClassGain]
    errors: Sequence[float]
    anew: ChosenAnew | None = None

    def of(self, wanted: Collection[str] | None) -> ClassGain:
        """Return the gain of a class by its variables, None for all effects; zero if unknown."""
        return self.gains.get(frozenset(wanted or ()), ClassGain(DensityGains(()), 0.0, 0.0))

    def but_for(self, _ignored: Collection[str]) -> KnownGains:
        """Return unchanged gains, because events in tests are random effects here and simulator terms do not follow time."""
        return self

    def errors_with(self, _wanted: Collection[str]) -> list[float]:
        """Return the rms errors with all effects, because they are applied together."""
        return list(self.errors)


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
    errors: Callable[[Sequence[Collection[str]]], Sequence[float]],
    asked: Callable[[Cause], bool] = lambda _: True,
    **limits: Any,  # noqa: ANN401 - as of `search`
) -> KnownGains | None:
    """Return gains of causes and classes in groups of tests; None without groups or causes.

    Args:
        rows: of each group, shape (n,).
        errors: function from sets of names to rms errors of predicting groups without each set's causes.
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
    anew = chosen_anew(*comparisons, choose, settled.bank.kind_of, asked, (classes, follow))
    names = [member.name for member in settled.best.members]
    without = [{name for name in names if follow(name) & wanted} for wanted in classes]
    error, *others = errors([(), *without, names])
    counts = tuple(int(one.sum()) for one in rows)
    parts = [*(tuple(part[key] for part in anew.of_classes) for key in classes), anew.whole]
    every = zip([*classes, frozenset[str]()], parts, others, strict=True)
    gains = {key: ClassGain(DensityGains(part, counts), before, error) for key, part, before in every}
    return KnownGains(rows, gains, [error] * len(rows), anew)


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
    classes: Classes = ((), lambda _: frozenset()),
) -> ChosenAnew:
    """Select causes without each part, and predict this part.

    Args:
        choose: function from a comparison to its most probable members, starting from all rows' selection.
        kind_of: function from a cause to its kind.
        classes: effects of a class are omitted together.
    """
    brought, whole, of_classes, follows = [], [], [], classes[1]
    for others in of_others:
        chosen = choose(others)
        names = [member.name for member in chosen if asked(member.cause)]
        with_all = _predicted(of_all, others, chosen)
        found: dict[Kind, float] = {}
        for name in names:
            but_for = _predicted(of_all, others, [m for m in chosen if m.name != name])
            found[kind_of(name)] = found.get(kind_of(name), 0.0) + with_all - but_for
        rest = {wanted: [m for m in chosen if not follows(m.name) & wanted] for wanted in classes[0]}
        of_classes.append(
            {
                wanted: with_all - _predicted(of_all, others, less) if len(less) < len(chosen) else 0.0
                for wanted, less in rest.items()
            }
        )
        brought.append(found)
        whole.append(with_all)
        del others  # free the products before the next part needs as much memory
    return ChosenAnew(tuple(brought), tuple(whole), tuple(of_classes))


def _predicted(of_all: ModelComparison, of_others: ModelComparison, members: Sequence[Member]) -> float:
    return of_all.log_evidence(members) - of_others.log_evidence(members)
