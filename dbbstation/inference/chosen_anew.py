"""Each effect's gain in parts that took no part in its choice, by predictive density.

Without each part the set is chosen anew from all causes; nonlinear parameters stay within half a grid step. The part is
then predicted with the set and without each effect, refitted. The score is the log density [Good, Rational decisions,
J. R. Stat. Soc. B 14 (1952) 107]: the part's contribution to the log evidence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.inference.followed import ClassGain
from dbbstation.inference.verdict import DensityGains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.inference.folds import Kind
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison

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

    rows: Sequence[NDArray[np.bool_]]
    gains: Mapping[frozenset[str], ClassGain]
    errors: Sequence[float]
    anew: ChosenAnew | None = None

    @classmethod
    def of_tests(
        cls, rows: Sequence[NDArray[np.bool_]], anew: ChosenAnew, errors: Mapping[frozenset[str], float], error: float
    ) -> KnownGains:
        """Return the gains of groups of tests.

        Args:
            errors: rms errors of predicting groups without each class, by its variables; of the base alone under none.
            error: with everything.
        """
        counts = tuple(int(one.sum()) for one in rows)
        parts = {key: tuple(part[key] for part in anew.of_classes) if key else anew.whole for key in errors}
        gains = {key: ClassGain(DensityGains(parts[key], counts), before, error) for key, before in errors.items()}
        return cls(rows, gains, [error], anew)

    def of(self, wanted: Collection[str] | None) -> ClassGain:
        """Return the gain of everything over some variables; None: everything."""
        return self.gains[frozenset(wanted or ())]

    def but_for(self, _ignored: Collection[str]) -> KnownGains:
        """Return the same: what happens in a test is a random effect of it, and no term of a simulator follows the time."""
        return self

    def errors_with(self, _wanted: Collection[str]) -> list[float]:
        """Return the rms error of each part with everything, which is put in together."""
        return list(self.errors)


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
