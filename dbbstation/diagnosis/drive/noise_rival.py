"""Whether stretches in time are correlated noise.

Noise of any colour would absorb slow friction laws, so causes compete beside first-order noise. Stretches without a law
compete with noise of any colour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scipy.special import expit

from dbbstation.inference.patterns import Family
from dbbstation.inference.settle import log_probability

if TYPE_CHECKING:
    from dbbstation.inference.settled import Settled


def probability_beside_noise(settled: Settled) -> float:
    """Return the stretches' probability against noise of any colour beside other members.

    Noise is measured beside members [`Bank.measure`], with parameter cost and prior odds.
    """
    patterns = settled.bank.patterns
    others = settled.best.without(
        *(name for name in settled.best.names if name in patterns and patterns[name].family is Family.PULSES)
    )
    if len(others) == len(settled.best.members):
        return 1.0
    found = []
    for members in (settled.best.members, others):
        bank = settled.bank.copy()
        bank.measures_beside_members = True
        bank.measure(members)
        found.append(log_probability(bank, members))
    return float(expit(found[0] - found[1]))
