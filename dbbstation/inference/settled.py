"""What a comparison came to: the most probable hypothesis, the noise beside it, and what other beginnings of the noise came to."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.hypotheses import Hypothesis, search

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.bank import Bank
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.coloured import Coloured
    from dbbstation.inference.hypotheses import Posterior
    from dbbstation.inference.model_comparison import Cause, ModelComparison

MOST_EXPANDED = 8
"""Hypotheses whose neighbours are looked at in a search, at the most: a table may have dozens of members, each with neighbours."""


class Beginning(Enum):
    """What the noise is measured beside at first.

    Beside everything that a channel has, noise that wanders looks like curves. Beside nothing, what is smooth looks like noise.
    With long tails from the start, pulses look like outliers. So each is tried, and the most probable outcome is taken.
    """

    EVERYTHING = "everything"
    EVERYTHING_LONG_TAILS = "everything, then with long tails"
    NOTHING = "nothing"
    NOTHING_LONG_TAILS = "nothing, with long tails"


@dataclass(frozen=True, eq=False)
class Settled:
    """What the comparison came to.

    Attributes:
        bank: columns and causes.
        noise: of one row, from what everything together leaves.
        posterior: over sets of causes.
        refused: laws that would have to be what they cannot be, and why.
        beginning: what the noise was measured beside at first.
        log_probability: of the noise and the best hypothesis together, but for what is the same for all of a channel.
        others: what other beginnings came to, most probable first.
    """

    channel: Channel
    bank: Bank
    noise: Coloured
    causes: tuple[Cause, ...]
    comparison: ModelComparison
    posterior: Posterior
    refused: Mapping[str, str] = field(default_factory=dict)
    beginning: Beginning = Beginning.EVERYTHING
    log_probability: float = 0.0
    others: tuple[Settled, ...] = ()

    @property
    def best(self) -> Hypothesis:
        """The most probable hypothesis."""
        return self.posterior.best

    def effect(self, names: Sequence[str] | None = None) -> NDArray[np.float64]:
        """What members of the best hypothesis do, over all rows, in the unit of the residual, shape (n,)."""
        total = np.zeros(len(self.channel.residual))
        values = self.comparison.estimates(self.best.members).values if self.best.members else np.zeros(0)
        for member in self.best.members:
            own, values = values[: len(member.columns)], values[len(member.columns) :]
            if names is None or member.cause.name in names:
                total += self.bank.samples(member.columns) @ own
        return total

    def base_values(self, effect: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Values of the base columns beside an effect, that of all members if None, shape (k,)."""
        return self.bank.base_values(self.effect() if effect is None else effect)

    def predicted(self) -> NDArray[np.float64]:
        """What base and members say of the residual, over all rows, shape (n,)."""
        effect = self.effect()
        return np.asarray(effect + self.channel.base.samples @ self.base_values(effect), dtype=np.float64)

    def averaged(self, probability: float, names: Collection[str]) -> float:
        """Probability of causes over all beginnings of the noise.

        Args:
            names: of them; of effects that were looked for, others of the same family over the same variables count as the same.
        """
        if not self.others:
            return probability
        kinds = {self.bank.kind_of(name) for name in names}
        every = [probability]
        for other in self.others:
            alike = {cause.name for cause in other.causes if other.bank.kind_of(cause.name) in kinds}
            every.append(other.posterior.probability(alike | set(names)))
        weights = np.array([self.log_probability, *(other.log_probability for other in self.others)])
        weights = np.exp(weights - weights.max())
        return float(weights @ np.array(every) / weights.sum())

    def second_start(self) -> Hypothesis:
        """The most probable hypothesis that a search comes to that begins with nothing."""
        return search(self.comparison, self.causes, (), MOST_EXPANDED).best
