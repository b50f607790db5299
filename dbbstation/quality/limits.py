"""Limits that sound values exceed by chance with a stated probability."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, fdtri, stdtrit

from dbbstation.computing.arrays import median_of
from dbbstation.quality.finding import Name

if TYPE_CHECKING:
    from collections.abc import Sequence

FALSE_ALARMS_PER_RUN = 1e-3
"""Probability that a sound run has any finding: one in a thousand runs, or one in thirty-three sessions of thirty runs.
A false alarm costs a repeated circle, two minutes; a missed fault may cost the calibration."""

LOG_ODDS_LIMIT = -float(np.log(FALSE_ALARMS_PER_RUN))
"""Log odds that outweigh the prior of a mistake made in one sound run of a thousand."""

TESTED = len(Name) - 6
"""Number of findings that share it. A missing circle and lost samples are counted, not estimated. Copied readings, all
programs and the bar of all runs have separate probabilities. The comparison with the previous session is never
wrong."""

SHARE = FALSE_ALARMS_PER_RUN / TESTED
"""Probability of each finding [Bonferroni], valid also for dependent findings."""


FEWEST_OTHERS = 3
"""Fewest other runs, or pairs, whose scatter gives a limit; among two, a faulty one cannot be recognised."""


SCATTERING = 3
"""Dimensions in which runs of one circle scatter fully: the ball's X and Y, and the bar's length. The other four
coefficients scatter less; counting them would overstate the freedom of a limit."""


def quantile(freedom: float, share: float = SHARE) -> float:
    """Return the size, in standard deviations, that a sound value exceeds with probability `share` [Student].

    Args:
        freedom: degrees of freedom of the standard deviation; infinite if known.
        share: probability of both sides together.
    """
    freedom = min(max(freedom, 1.0), _MANY)
    return float(-stdtrit(freedom, 0.5 * share))


def largest_of(count: float, freedom: float) -> float:
    """Return `quantile` for the largest of `count` independent values."""
    return quantile(freedom, SHARE / max(count, 1.0))


def length_quantile(dimensions: int) -> float:
    """Return the length, in standard deviations, that a sound vector exceeds with probability SHARE."""
    return sqrt(chdtri(dimensions, SHARE))


def scaled_length_quantile(freedom: float) -> float:
    """Return the root of the chi-square quantile for real degrees of freedom."""
    return sqrt(chdtri(max(freedom, 1.0), SHARE))


def ratio_quantile(above: float, below: float) -> float:
    """Return the ratio of two variance estimates that is exceeded by chance with probability SHARE [Fisher]."""
    return float(fdtri(above, below, 1.0 - SHARE))


_MANY = 1e6
"""Degrees of freedom above which the normal distribution replaces Student's."""


def scale_of(values: Sequence[float]) -> tuple[float, float]:
    """Return a robust standard deviation about zero, and its degrees of freedom."""
    # The estimate is the median absolute value, divided by the median for a standard normal variable. It is as precise
    # as the standard deviation of 0.37 times as many sound values [Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993)].
    if not values:
        return 0.0, 0.0
    return median_of(np.abs(values)) / _NORMAL_MEDIAN, ROBUST_SHARE * len(values)


_NORMAL_MEDIAN = 0.674490
"""Median absolute value of a standard normal variable."""

ROBUST_SHARE = 0.37
"""Efficiency of the median absolute value: 100 values, some of them faulty, give the precision of 37 sound values."""


def length_limit(lengths: Sequence[float], dimensions: int) -> float:
    """Return the length that a sound vector exceeds with probability SHARE, given lengths of other vectors [Fisher].

    Args:
        lengths: of the other vectors; only their median square counts.
    """
    median = float(chdtri(dimensions, 0.5)) / dimensions
    variance = median_of(np.square(lengths)) / median
    known = ROBUST_SHARE * dimensions * len(lengths)
    return sqrt(variance * ratio_quantile(dimensions, max(known, 1.0)))


def median_length(dimensions: int) -> float:
    """Return the median length of a sound vector, in standard deviations."""
    return sqrt(chdtri(dimensions, 0.5))


def joined(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return standard deviation and degrees of freedom of a sum of independent parts [Welch, Satterthwaite; GUM G.4.1]."""
    variance = sum(size**2 for size, _ in parts)
    if not variance > 0.0:
        return 0.0, _MANY
    below = sum(size**4 / freedom for size, freedom in parts if size > 0.0 and freedom > 0.0)
    return sqrt(variance), float(variance**2 / below) if below > 0.0 else _MANY
