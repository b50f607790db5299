"""The outcome of a comparison, with noise and outcomes from other initial noise models."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.bank import Bank
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.coloured import Coloured
    from dbbstation.inference.hypotheses import Hypothesis, Posterior
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison


class Beginning(Enum):
    """Initial noise models, by the causes whose residual gives the first noise.

    All are tried, because wandering noise resembles curves, smooth effects resemble noise, and pulses resemble outliers.
    """

    EVERYTHING = "everything"
    EVERYTHING_LONG_TAILS = "everything, then with long tails"
    NOTHING = "nothing"
    NOTHING_LONG_TAILS = "nothing, with long tails"


@dataclass(frozen=True, eq=False)
class Settled:
    """The outcome of a comparison.

    Attributes:
        stopped: whether the search reached its limit of work; the result is then the best so far.
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
    stopped: bool = False

    @property
    def best(self) -> Hypothesis:
        """Return the most probable hypothesis."""
        return self.posterior.best

    def effect(self, names: Collection[str] | None = None, members: Sequence[Member] | None = None) -> Floats:
        """Return the effect of some members over all rows, in the residual's unit, shape (n,).

        Args:
            members: members to fit together; None for the best ones.
        """
        total, members = np.zeros(len(self.channel.residual)), self.best.members if members is None else members
        for member, values, _ in self.comparison.estimated(members):
            if names is None or member.name in names:
                total += self.bank.samples(member.columns) @ values
        return total

    def base_values(self, effect: Floats | None = None) -> Floats:
        """Return the refitted base's values, shape (k,), given an effect; None for all members' effect."""
        return self.bank.base_values(self.effect() if effect is None else effect)

    def predicted(self) -> Floats:
        """Return the sum of base and members over all rows, shape (n,)."""
        effect = self.effect()
        return effect + self.channel.base.samples @ self.base_values(effect)

    @property
    def left(self) -> Floats:
        """Return the residual beside the members, over all rows, shape (n,)."""
        return self.channel.residual - self.predicted()

    def averaged(self, probability: float, names: Collection[str]) -> float:
        """Return the probability of causes, averaged over initial noise models.

        Args:
            names: causes; found patterns of one family over equal variables count together.
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
        return min(1.0, float(weights @ np.array(every) / weights.sum()))  # it can round to more
