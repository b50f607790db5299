"""What each effect brings in parts that took no part in choosing it, by the density of the prediction.

Without each part the set of causes is chosen anew, from all that is listed, about the columns of all rows: places of waves, bumps and
steps, and nonlinear parameters to within half a step of their grid, are those of all. Then the part is predicted with what was chosen,
and with that but for one effect, base and other effects fitted anew without the part.

A prediction is scored by its log density [Good, Rational decisions, J. R. Stat. Soc. B 14 (1952) 107], which counts errors by how well
they are known: noise, random effects that only the part knows, such as where its balls came to stand, and what the other parts leave
open of the base. Squares of errors alone are mostly the last two. What a part adds to the log evidence of a set is that density.
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
        brought: by kind, in each part, what an effect brought: log density of the prediction with it less that without it; not given
            where it was not chosen.
        whole: in each part, the same of everything that was chosen, over the base alone.
    """

    brought: tuple[dict[Kind, float], ...]
    whole: tuple[float, ...]

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """What effects of some kinds brought together in each part; nothing where none of them was chosen."""
        return DensityGains(tuple(sum(part.get(kind, 0.0) for kind in set(kinds)) for part in self.brought))

    @property
    def is_worse(self) -> bool:
        """Whether what was chosen predicts worse than the base alone does."""
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
        of_all: causes beside the base over all rows.
        choose: members of the most probable set, in a search that begins with what was chosen from all rows.
        kind_of: name of a cause to what tells it from other places or periods of the same.
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
    """Log density of the part that was held back, over that by the base alone."""
    return of_all.log_evidence(members) - of_others.log_evidence(members)
