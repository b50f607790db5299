"""Run length of a control chart: a CUSUM combined with a limit for single values.

The chart takes standardised values z, independent and standard normal without change. Upwards it adds S = max(0, S + z
- k) and signals at S > h [Page 1954, Biometrika 41, 100], or at z > c [Lucas 1982, J. Quality Technology 14, 51];
downwards it does the same with -z. Run lengths come from the Markov chain of [Brook and Evans 1972, Biometrika 59,
539], with any number of decimals and no approximation of h.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

STATES = 201
"""States of the Markov chain. Twice as many change the average run length by less than a thousandth."""

REFERENCE = 0.5
"""k [standard deviations]: half the change to be found soonest [Page 1954], here one standard deviation of a session.
`python -m studies history` compares other values."""

SINGLE_SHARE = 0.5
"""Share of false alarms allowed to the limit for single sessions; the CUSUM may cause the others. The limit detects a
large step at once, before the step widens the estimated scatter."""


@dataclass(frozen=True)
class Chart:
    """Limits of a two-sided chart, in standard deviations of one value.

    Attributes:
        reference: k, subtracted from every value.
        interval: h, beyond which a sum signals.
        single: c, beyond which one value signals.
    """

    reference: float
    interval: float
    single: float = np.inf


def transitions(chart: Chart, mean: float = 0.0) -> Floats:
    """Return transition probabilities of the upward sum, shape (STATES, STATES); each row's complement to one is the probability of a signal."""
    width = 2.0 * chart.interval / (2.0 * STATES - 1.0)  # the last state's upper edge is h
    state = np.arange(STATES)
    edges = (state[None, :] - state[:, None] + 0.5) * width + chart.reference
    below = ndtr(np.minimum(edges, chart.single) - mean)
    return np.diff(below, axis=1, prepend=0.0)


def average_run_length(chart: Chart, mean: float = 0.0) -> float:
    """Return the average number of values until the two-sided chart signals, starting from zero sums.

    The rates of both directions add up [Kemp 1961, J. R. Stat. Soc. B 23, 149].
    """
    lengths = (
        np.linalg.solve(np.eye(STATES) - transitions(chart, side * mean), np.ones(STATES)) for side in (1.0, -1.0)
    )
    return 1.0 / sum(1.0 / float(length[0]) for length in lengths)


@cache
def chart_for(false_alarms: float, reference: float = REFERENCE, single_share: float = SINGLE_SHARE) -> Chart:
    """Return the chart with this rate of false alarms.

    Args:
        false_alarms: per value, both directions: one over the average run length.
        single_share: share of false alarms from single values; 0 for a plain CUSUM.
    """
    single = -float(ndtri(false_alarms * single_share / 2.0)) if single_share else np.inf

    def beyond(interval: float) -> float:
        return float(np.log(average_run_length(Chart(reference, interval, single)) * false_alarms))

    # A plain one-sided CUSUM runs for about exp(2 k (h + 1.166)) / (2 k²) values [Siegmund 1985, Sequential Analysis, 2.56].
    plain = 2.0 / (false_alarms * (1.0 - single_share))
    guess = float(np.log1p(2.0 * reference**2 * plain)) / (2.0 * reference) - 1.166
    return Chart(reference, float(brentq(beyond, 0.1, max(guess, 0.0) + 2.0 / reference, xtol=1e-6)), single)
