"""Length of a vector in the plane, such as a centre offset, without what noise adds to it."""

from __future__ import annotations

import numpy as np
from scipy.special import chndtr, chndtrinc

from dbbstation.circles.extremes import QUANTILE

LONG = 100.0
"""Standard uncertainties from which the noise across the vector no longer counts: it adds 1/200 of one."""

AXES = 2
"""Degrees of freedom."""


def without_noise(length: float, u: float) -> tuple[float, float]:
    """Return the length that shows in the median what was measured, and its standard uncertainty.

    The length of a vector with the standard uncertainty u in either axis has Rice's distribution; its square over u² is a noncentral
    chi-square with two degrees of freedom [Rice, Bell System Technical Journal 24 (1945) 46, sec. 3.10]. Lengths that show what was
    measured at their 2.5th and 97.5th percentile are the ends of the 95 % interval [confidence interval by inversion of a test,
    Casella and Berger, Statistical Inference, 9.2.1]. Its longer side over 1.96 is the standard uncertainty, u at the least.

    Args:
        length: as measured, not negative.
        u: standard uncertainty of either coordinate, in the same unit.
    """
    if not u > 0.0 or length > LONG * u:
        return float(np.sqrt(length**2 - u**2)), u
    square = (length / u) ** 2

    def shows(share: float) -> float:
        """Length that is seen as shorter in such a share of all cases, in u."""
        return float(np.sqrt(chndtrinc(square, AXES, share))) if chndtr(square, AXES, 0.0) > share else 0.0

    low, value, high = (shows(share) for share in (0.975, 0.5, 0.025))
    return u * value, u * max(value - low, high - value, QUANTILE) / QUANTILE
