"""Each effect's gain in parts that took no part in its choice, by predictive density.

Without each part the set is chosen anew from all causes; nonlinear parameters stay within half a grid step. The part is
then predicted with the set and without each effect, refitted. The score is the log density [Good, Rational decisions,
J. R. Stat. Soc. B 14 (1952) 107]: the part's contribution to the log evidence. How often a cause is chosen without some
of the tests is asked of the same comparisons.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.followed import ClassGain, VariableProbabilities, classes_of, follow_of
from dbbstation.inference.hypotheses import CLOSE, search
from dbbstation.inference.verdict import DensityGains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Integers
    from dbbstation.inference.folds import Kind
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison
    from dbbstation.inference.settled import Settled

Classes: TypeAlias = "tuple[Sequence[frozenset[str]], Callable[[str], frozenset[str]]]"
"""Classes of variables, and what each cause follows."""

LEAST_PARTS = 4
"""Parts from which on what they say of each other is more than chance: a gain without the best of them, and a spread."""


@dataclass(frozen=True, eq=False)
class ChosenAnew:
    """Gains in parts held back in turn.

    Attributes:
        brought: by kind, log density per part, with minus without; absent if not chosen.
        whole: per part, of everything over the base.
        of_classes: by class of variables, log density per part, with minus without.
    """

    brought: tuple[dict[Kind, float], ...]
    whole: tuple[float, ...]
    of_classes: tuple[Mapping[frozenset[str], float], ...] = ()

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """Return the joint gain of kinds per part; empty if never chosen."""
        return DensityGains(tuple(sum(part.get(kind, 0.0) for kind in set(kinds)) for part in self.brought))

    @property
    def is_worse(self) -> bool:
        """Return whether the choice predicts worse than the base."""
        return sum(self.whole) < 0.0


@dataclass(frozen=True, eq=False)
class KnownGains:
    """Held-out gains of classes that were asked for beforehand.

    Attributes:
        rows: of each part, shape (n,).
        gains: of each class, by its variables; of everything under none.
        errors: rms error of each part with everything, or of all.
        anew: what was chosen without each part; None where gains are all that is known.
    """

    rows: Sequence[Flags]
    gains: Mapping[frozenset[str], ClassGain]
    errors: Sequence[float]
    anew: ChosenAnew | None = None

    def of(self, wanted: Collection[str] | None) -> ClassGain:
        """Return the gain of everything over some variables; None: everything. A class that none follows gains nothing."""
        return self.gains.get(frozenset(wanted or ()), ClassGain(DensityGains(()), 0.0, 0.0))

    def but_for(self, _ignored: Collection[str]) -> KnownGains:
        """Return the same: what happens in a test is a random effect of it, and no term of a simulator follows the time."""
        return self

    def errors_with(self, _wanted: Collection[str]) -> list[float]:
        """Return the rms error of each part with everything, which is put in together."""
        return list(self.errors)


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
) -> KnownGains:
    """Return each cause's gain in groups of tests, and each class's.

    Args:
        rows: of each group, shape (n,).
        errors: rms errors of predicting groups without causes of these names, for each of several sets.
        limits: of the searches without a group.
    """

    def choose(comparison: ModelComparison) -> Sequence[Member]:
        return search(comparison, settled.causes, [settled.best.members], **limits).best.members

    # Columns of earlier layouts are in no cause any more.
    used = columns_of(settled.causes)
    comparisons = settled.comparison, (settled.bank.without(out, used) for out in rows)
    follow = follow_of(settled)
    classes = [one.wanted for one in classes_of(settled, VariableProbabilities(settled))]
    anew = chosen_anew(*comparisons, choose, settled.bank.kind_of, asked, (classes, follow))
    names = [member.cause.name for member in settled.best.members]
    without = [{name for name in names if follow(name) & wanted} for wanted in classes]
    error, *others = errors([(), *without, names])
    counts = tuple(int(one.sum()) for one in rows)
    parts = [*(tuple(part[key] for part in anew.of_classes) for key in classes), anew.whole]
    every = zip([*classes, frozenset[str]()], parts, others, strict=True)
    gains = {key: ClassGain(DensityGains(part, counts), before, error) for key, part, before in every}
    return KnownGains(rows, gains, [error], anew)


SHARE = 0.7
"""Of the groups of tests that each draw keeps."""


def selection_frequency(
    groups: Sequence[int],
    causes: Sequence[Cause],
    without: Callable[[Flags], ModelComparison],
    rng: np.random.Generator,
    begin: Sequence[Member] = (),
    most_members: int | None = None,
) -> dict[str, float]:
    """Return each cause's share of selections.

    Each draw keeps seven tenths of the groups without replacement, because repeated groups look certain [Meinshausen
    and Bühlmann, J. R. Stat. Soc. B 72 (2010) 417, sec. 2, draw halves]. Groups, such as tests, are kept together.

    Args:
        groups: of each run.
        without: from runs that are left out, shape (r,).
    """
    names = np.array(sorted(set(groups)))
    kept_groups = max(int(np.ceil(SHARE * len(names))), min(len(names), 2))
    times = dict.fromkeys((cause.name for cause in causes), 0)
    for _ in range(BOUNDS.selection_draws):
        comparison = without(~np.isin(groups, rng.choice(names, kept_groups, replace=False)))
        found = search(comparison, causes, [begin], most_members=most_members, likely=CLOSE, thorough=not begin)
        for name in found.best.names:
            times[name] += 1
    return {name: count / BOUNDS.selection_draws for name, count in times.items()}


def columns_of(causes: Iterable[Cause]) -> Integers:
    """Return all columns of causes, rising."""
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
    """Choose anew without each part, and predict it.

    Args:
        choose: most probable members, starting from all rows' choice.
        kind_of: from a cause to its kind.
        classes: effects of a class are left out together.
    """
    brought, whole, of_classes, follows = [], [], [], classes[1]
    for others in of_others:
        chosen = choose(others)
        names = [member.cause.name for member in chosen if asked(member.cause)]
        with_all = _predicted(of_all, others, chosen)
        found: dict[Kind, float] = {}
        for name in names:
            but_for = _predicted(of_all, others, [m for m in chosen if m.cause.name != name])
            found[kind_of(name)] = found.get(kind_of(name), 0.0) + with_all - but_for
        rest = {wanted: [m for m in chosen if not follows(m.cause.name) & wanted] for wanted in classes[0]}
        of_classes.append(
            {
                wanted: with_all - _predicted(of_all, others, less) if len(less) < len(chosen) else 0.0
                for wanted, less in rest.items()
            }
        )
        brought.append(found)
        whole.append(with_all)
        del others  # its products fill as much memory as those of the next part will
    return ChosenAnew(tuple(brought), tuple(whole), tuple(of_classes))


def _predicted(of_all: ModelComparison, of_others: ModelComparison, members: Sequence[Member]) -> float:
    return of_all.log_evidence(members) - of_others.log_evidence(members)
