"""Each effect's gain in parts that took no part in its choice, by predictive density.

Without each part the set is chosen anew from all listed causes; places and nonlinear parameters are those of all rows
within half a grid step. The part is then predicted with the set and without each effect, refitted. The score is the log
density [Good, Rational decisions, J. R. Stat. Soc. B 14 (1952) 107], which includes noise, the part's own random effects
and open directions of the base: what a part adds to a set's log evidence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.inference.verdict import DensityGains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from dbbstation.inference.folds import Kind
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison

LEAST_PARTS = 4
"""Parts from which on what they say of each other is more than chance: a gain without the best of them, and a spread."""


@dataclass(frozen=True, eq=False)
class ChosenAnew:
    """What was found when parts were held back in turn.

    Attributes:
        brought: by kind, log density per part with less without it; absent if not chosen.
        whole: per part, of everything over the base.
    """

    brought: tuple[dict[Kind, float], ...]
    whole: tuple[float, ...]

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """Return the joint gain of kinds per part; empty if never chosen."""
        return DensityGains(tuple(sum(part.get(kind, 0.0) for kind in set(kinds)) for part in self.brought))

    @property
    def is_worse(self) -> bool:
        """Return whether the choice predicts worse than the base."""
        return sum(self.whole) < 0.0


def chosen_anew(
    of_all: ModelComparison,
    of_others: Iterable[ModelComparison],
    choose: Callable[[ModelComparison], Sequence[Member]],
    kind_of: Callable[[str], Kind],
    asked: Callable[[Cause], bool] = lambda _: True,
) -> ChosenAnew:
    """Choose anew without each part, and predict it.

    Args:
        of_all: causes over all rows.
        choose: most probable members, starting from all rows' choice.
        kind_of: from a cause to its kind.
    """
    brought, whole = [], []
    for others in of_others:
        chosen = choose(others)
        names = [member.cause.name for member in chosen if asked(member.cause)]
        with_all = _predicted(of_all, others, chosen)
        found: dict[Kind, float] = {}
        for name in names:
            but_for = _predicted(of_all, others, [m for m in chosen if m.cause.name != name])
            found[kind_of(name)] = found.get(kind_of(name), 0.0) + with_all - but_for
        brought.append(found)
        whole.append(with_all)
        del others  # its products fill as much memory as those of the next part will
    return ChosenAnew(tuple(brought), tuple(whole))


def _predicted(of_all: ModelComparison, of_others: ModelComparison, members: Sequence[Member]) -> float:
    """Return a held-back part's log density over the base's."""
    return of_all.log_evidence(members) - of_others.log_evidence(members)
