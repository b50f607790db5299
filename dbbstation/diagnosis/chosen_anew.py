"""What each named cause brings in tests that took no part in choosing it.

Tests are held back in groups. Without each group the set of causes is chosen anew, from all that is listed, about the joint fit of all
tests: places of waves, bumps and steps, and nonlinear parameters to within half a step of their grid, are those of all tests. Then the
group is predicted with what was chosen, and with that but for one cause, base and other causes fitted anew without it.

A prediction is scored by its log density [Good, Rational decisions, J. R. Stat. Soc. B 14 (1952) 107], which counts errors by how well
they are known: noise, where the balls of these tests came to stand, and what the other tests leave open of the geometry. Squares of errors
alone are mostly the last two. What a group adds to the log evidence of a set is that density.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.diagnosis.explain import MOST_MEMBERS
from dbbstation.diagnosis.left_out import tests_of
from dbbstation.inference.folds import FOLDS
from dbbstation.inference.hypotheses import search
from dbbstation.inference.verdict import Gains

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.diagnosis.explain import Explained

LEAST_GROUPS = 4
"""Groups of tests from which on a gain in seven tenths of them is more than chance."""


@dataclass(frozen=True, eq=False)
class ChosenAnew:
    """What was found when groups of tests were held back in turn.

    Attributes:
        brought: by name, in each group, what a cause brought: log density of the prediction with it less that without it; not given where
            it was not chosen.
        whole: in each group, the same of everything that was chosen, over the kinematic calibration.
    """

    brought: tuple[dict[str, float], ...]
    whole: tuple[float, ...]

    def gains(self, names: Iterable[str]) -> Gains:
        """Of causes that nothing measured here tells apart: what any of them brought in each group."""
        wanted = tuple(names)
        return Gains(tuple(sum(one.get(name, 0.0) for name in wanted) for one in self.brought))

    @property
    def worse(self) -> bool:
        """Whether what was chosen predicts worse than the kinematic calibration does."""
        return sum(self.whole) < 0.0


def chosen_anew(explained: Explained) -> ChosenAnew | None:
    """Hold back groups of tests in turn; None where there are too few, or where no cause was named."""
    settled, channel = explained.settled, explained.channel
    tests = np.array(tests_of(channel.observations))
    groups = tests % min(FOLDS, int(tests.max()) + 1)
    if not settled.members or len(set(groups.tolist())) < LEAST_GROUPS:
        return None
    target = channel.target(settled.after)
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    of_all = channel.beside_base(noise_mm, settled.scatter).comparison(target)
    brought, whole = [], []
    for group in sorted(set(groups.tolist())):
        out = np.zeros(len(target), dtype=bool)
        for rows, own in zip(channel.runs, groups, strict=True):
            out[rows] = own == group
        of_others = channel.beside_base(noise_mm, settled.scatter, but_for=out).comparison(np.where(out, 0.0, target))
        chosen = search(of_others, settled.causes, [settled.best.members], most_members=MOST_MEMBERS).best.members
        sets = [chosen, *([o for o in chosen if o is not m] for m in chosen if m.cause.named)]
        predicted = [of_all.log_evidence(some) - of_others.log_evidence(some) for some in sets]
        names = [m.cause.name for m in chosen if m.cause.named]
        brought.append({name: predicted[0] - but_for for name, but_for in zip(names, predicted[1:], strict=True)})
        whole.append(predicted[0])
    return ChosenAnew(tuple(brought), tuple(whole))
