"""The outcome of a comparison, with noise and outcomes from other initial noise models."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

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


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """The outcome of a comparison of sets of causes.

    Attributes:
        stopped: whether the search ended early; the result is then the best so far.
    """

    causes: tuple[Cause, ...]
    comparison: ModelComparison
    posterior: Posterior
    stopped: bool = False

    @property
    def best(self) -> Hypothesis:
        """Return the selected hypothesis."""
        return self.posterior.best


@dataclass(frozen=True, eq=False, kw_only=True)
class Settled(Outcome):
    """The outcome with its noise."""

    channel: Channel
    bank: Bank
    noise: Coloured
    refused: Mapping[str, str] = field(default_factory=dict)
    beginning: Beginning = Beginning.EVERYTHING
    log_probability: float = 0.0
    others: tuple[Settled, ...] = ()

    @property
    def weighted(self) -> list[tuple[Settled, float]]:
        """Return the outcomes from all initial noise models, with their probabilities."""
        every = [self, *self.others]
        logs = np.array([one.log_probability for one in every])
        return list(zip(every, np.exp(logs - logsumexp(logs)).tolist(), strict=True))

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

    def probability(self, names: Collection[str]) -> float:
        """Return the probability that at least one cause is present, averaged over initial noise models.

        Args:
            names: causes; found patterns of one family over equal variables count together.
        """
        kinds, total = {self.bank.kind_of(name) for name in names}, 0.0
        for one, share in self.weighted:
            alike = [] if one is self else [c.name for c in one.causes if one.bank.kind_of(c.name) in kinds]
            total += share * one.posterior.probability([*names, *alike])
        return min(1.0, total)  # it can round to more
