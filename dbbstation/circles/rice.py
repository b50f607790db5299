"""Length of a plane vector, such as a centre offset, without the contribution of noise."""

from __future__ import annotations

import numpy as np
from scipy.special import chndtr, chndtrinc

from dbbstation.circles.extremes import QUANTILE

LONG = 100.0
"""Length in standard uncertainties above which noise perpendicular to the vector is negligible: it adds 1/200 of one."""

AXES = 2
"""Degrees of freedom."""


def without_noise(length: float, u: float) -> tuple[float, float]:
    """Return the true length whose median measured length is the given one, with standard uncertainty."""
    # With uncertainty u per axis the length has Rice's distribution [Rice, Bell System Technical Journal 24 (1945) 46,
    # sec. 3.10]. Inverting the percentiles 2.5 and 97.5 gives the 95 % interval [confidence interval by inversion of a
    # test, Casella and Berger, Statistical Inference, 9.2.1]. The uncertainty is its longer side over 1.96, at least u.
    if not u > 0.0 or length > LONG * u:
        return float(np.sqrt(length**2 - u**2)), u
    square = (length / u) ** 2

    def shows(share: float) -> float:
        """Return the true length, in u, that is measured shorter than `length` with probability `share`."""
        return float(np.sqrt(chndtrinc(square, AXES, share))) if chndtr(square, AXES, 0.0) > share else 0.0

    low, value, high = (shows(share) for share in (0.975, 0.5, 0.025))
    return u * value, u * max(value - low, high - value, QUANTILE) / QUANTILE
