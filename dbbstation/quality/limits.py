"""Limits that chance passes with a stated probability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, fdtri, stdtrit

from dbbstation.quality.finding import Name

if TYPE_CHECKING:
    from collections.abc import Sequence

FALSE_ALARMS_PER_RUN = 1e-3
"""Probability that a sound run has any finding: one in a thousand runs, which is one in thirty-three sessions of thirty. A
false alarm costs a repeated circle, two minutes; one that is missed may cost the calibration."""

LOG_ODDS_LIMIT = -float(np.log(FALSE_ALARMS_PER_RUN))
"""Logarithm of the odds that outweigh a mistake which one sound run in a thousand has."""

TESTED = len(Name) - 6
"""Findings that share it: all but a recording without a circle and lost samples, which are counted and not estimated, readings of
another run, all programs and the bar of all runs, which have probabilities of their own, and the session before, which is never wrong."""

SHARE = FALSE_ALARMS_PER_RUN / TESTED
"""Probability of each [Bonferroni]: they may depend on one another."""


FEWEST_OTHERS = 3
"""Other runs, or pairs of runs, that must be there for their scatter to say what is usual: of two nobody knows which is spoilt."""


SCATTERING = 3
"""Dimensions in which runs of one circle scatter at the least: where the ball came to lie in X and Y, and how long the bar is.
The other four numbers scatter less; were they counted in full, a limit would be taken for better known than it is."""


def quantile(freedom: float, share: float = SHARE) -> float:
    """Return the size in standard deviations that a sound value passes with probability `share` [Student].

    Args:
        freedom: of the standard deviation; infinite if known.
        share: both sides together.
    """
    freedom = min(max(freedom, 1.0), _MANY)
    return float(-stdtrit(freedom, 0.5 * share))


def largest_of(count: float, freedom: float) -> float:
    """Return the same for the largest of `count` independent values."""
    return quantile(freedom, SHARE / max(count, 1.0))


def length_quantile(dimensions: int) -> float:
    """Return the length in standard deviations that a sound vector passes with probability SHARE."""
    return float(np.sqrt(chdtri(dimensions, SHARE)))


def scaled_length_quantile(freedom: float) -> float:
    """Return the root of the chi-square quantile for any real freedom."""
    return float(np.sqrt(chdtri(max(freedom, 1.0), SHARE)))


def ratio_quantile(above: float, below: float) -> float:
    """Return the ratio of two variance estimates that chance passes with probability SHARE [Fisher]."""
    return float(fdtri(above, below, 1.0 - SHARE))


_MANY = 1e6
"""Degrees of freedom from which Student's distribution is the normal one."""


def scale_of(values: Sequence[float]) -> tuple[float, float]:
    """Return the robust standard deviation about zero, and its freedom.

    The median absolute value over that of a normal value; as precise as 0.37 times as many sound values [Rousseeuw and
    Croux, J. Am. Stat. Assoc. 88 (1993)].
    """
    if not values:
        return 0.0, 0.0
    return float(np.median(np.abs(values))) / _NORMAL_MEDIAN, ROBUST_SHARE * len(values)


_NORMAL_MEDIAN = 0.674490
"""Median of the size of a normal value of standard deviation one."""

ROBUST_SHARE = 0.37
"""Share of values that a median of sizes knows a standard deviation as well as: 37 sound ones of 100 that may be spoilt."""


def length_limit(lengths: Sequence[float], dimensions: int) -> float:
    """Return the length that a sound vector passes with probability SHARE, given others [Fisher].

    Args:
        lengths: of others; their median square counts.
    """
    median = float(chdtri(dimensions, 0.5)) / dimensions
    variance = float(np.median(np.square(lengths))) / median
    known = ROBUST_SHARE * dimensions * len(lengths)
    return float(np.sqrt(variance * ratio_quantile(dimensions, max(known, 1.0))))


def median_length(dimensions: int) -> float:
    """Return the median length of a sound vector, in standard deviations."""
    return float(np.sqrt(chdtri(dimensions, 0.5)))


def joined(parts: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the standard deviation and freedom of a sum of independent parts [Welch, Satterthwaite; GUM G.4.1]."""
    variance = sum(size**2 for size, _ in parts)
    if not variance > 0.0:
        return 0.0, _MANY
    below = sum(size**4 / freedom for size, freedom in parts if size > 0.0 and freedom > 0.0)
    return float(np.sqrt(variance)), float(variance**2 / below) if below > 0.0 else _MANY
