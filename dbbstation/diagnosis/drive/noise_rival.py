"""Whether stretches of time are noise whose neighbours resemble each other.

Noise of a drive is of first order while causes are compared: noise of any colour takes up laws of friction, which are slow and least exact
where the force changes fast. Stretches of time have no law, and low-passed or resonant noise looks like some of them. So noise of any
colour competes with these alone, beside the laws that were found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scipy.special import expit

from dbbstation.inference.patterns import Family
from dbbstation.inference.settle import log_probability

if TYPE_CHECKING:
    from dbbstation.inference.settled import Settled


def probability_beside_noise(settled: Settled) -> float:
    """Probability of the stretches of time of the best hypothesis, against noise of any colour beside its other members.

    In both cases the noise is measured beside the members [`Bank.measure`], its parameters are paid for, and the prior odds of the
    stretches count.
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
