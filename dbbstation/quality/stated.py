"""Compute the allowed difference of two runs from errors that the files state, or from usual errors.

Shared causes cancel if their effects are equal; the difference has the covariance of [GUM 5.2.2].
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import norm_of, sum_of
from dbbstation.quality.limits import length_quantile, scaled_length_quantile

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TypeAlias

    from dbbstation.computing.arrays import Floats
    from dbbstation.quality.knowledge import Seen
    from dbbstation.trace.expected import Expected

    Effects: TypeAlias = Mapping[tuple[str, str], Floats]


def apart_by_causes(one: Expected, other: Expected) -> Floats:
    """Return the covariance of two forms' difference by all known causes, shape (7, 7) [µm²]."""
    return apart_by(one.effects_um, other.effects_um, len(one.form_um))


def apart_by(one_um: Effects, other_um: Effects, count: int) -> Floats:
    """Return the covariance of two forms' difference by causes, shape (n, n) [µm²]."""
    covariance = np.zeros((count, count))
    for key in dict.fromkeys([*one_um, *other_um]):
        mine, theirs = one_um.get(key), other_um.get(key)
        if mine is not None and theirs is not None and mine.shape == theirs.shape:
            covariance += (mine - theirs) @ (mine - theirs).T
            continue
        for effect in (mine, theirs):
            if effect is not None:
                covariance += effect @ effect.T
    return covariance


def covariance_apart(one: Seen, other: Seen) -> Floats | None:
    """Return the covariance of the difference of two runs of one circle, noise included, shape (7, 7) [µm²]; None without expectation.

    Movements below the ball's stated uncertainty do not count.
    """
    if one.run.expected is None or other.run.expected is None:
        return None
    covariance = apart_by_causes(one.run.expected, other.run.expected)
    covariance += unseen_um2(one, other) * np.eye(len(covariance))
    covariance[0, 0] += drifted_um(one, other) ** 2
    return covariance


def sigmas_apart(one: Seen, other: Seen) -> float | None:
    """Return the difference of two runs in stated standard deviations, or None."""
    covariance = covariance_apart(one, other)
    if covariance is None:
        return None
    off = one.coefficients_um - other.coefficients_um
    return sqrt(off @ np.linalg.solve(covariance, off))


def drifted_um(one: Seen, other: Seen) -> float:
    """Return the standard deviation of the mean reading's drift between two runs, extrapolated from their turns [µm]."""
    if one.run.started_s is None or other.run.started_s is None:
        return 0.0
    rate = sqrt(0.5 * (one.drift_um_s**2 + other.drift_um_s**2))
    return rate * abs(one.run.started_s - other.run.started_s)


def unseen_um2(one: Seen, other: Seen) -> float:
    """Return each coefficient's variance due to noise and the ball's stated uncertainty [µm²]."""
    expected = one.run.expected
    place_um = 0.0 if expected is None else expected.place_um
    # A shift d changes two coefficients by d / sqrt 2 each.
    return one.u_um**2 + other.u_um**2 + 0.5 * place_um**2


def limit_along(covariance: Floats, off: Floats) -> float:
    """Return a sound vector's limit along `off`, from the ellipsoid that it leaves with probability SHARE."""
    size = norm_of(off)
    along = off / size if size > 0.0 else np.eye(len(off))[0]
    return length_quantile(len(off)) / sqrt(along @ np.linalg.solve(covariance, along))


def limit_of_length(covariance: Floats) -> float:
    """Return the limit of a sound vector's length [Box, Ann. Math. Stat. 25 (1954) 290].

    The squared length is approximated by a scaled chi-square variable of equal mean and variance.
    """
    trace, squares = float(np.trace(covariance)), sum_of(covariance**2)
    return scaled_length_quantile(trace**2 / squares) * sqrt(squares / trace) if trace > 0.0 else 0.0
