"""Detect local differences from another run of a test: dirt, contact, a push.

In a single run the form hides a wide bump, but two runs share the form. All undulations of repeats are compared. With
the other direction only odd undulations are compared, because lag, play and friction nearly repeat after half a turn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import norm_of, place_of_largest
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.knowledge import LOCAL_COEFFICIENTS, LOCAL_HARMONIC, local_columns
from dbbstation.quality.limits import FEWEST_OTHERS, SCATTERING, length_limit
from dbbstation.quality.stated import apart_by, limit_along

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.quality.knowledge import Others, Seen

LOWEST = 3
"""Lowest undulations per revolution compared here. The second contains a shift's second order and most differences by
reversals; lower ones contain place and length."""

OTHER_REVERSALS = 0.25
"""Allowed ratio of odd to even undulations without a known cause: unmodelled play and friction repeat after nearly half
a turn. Known causes give 0.22 on the fifteen circles of `table2` with 10 to 30 µm of play in all struts. A bump of 10
µm and 60 degrees' width gives four times as much."""

ORDERS = np.concatenate([[0], np.arange(1, LOCAL_HARMONIC + 1), np.arange(1, LOCAL_HARMONIC + 1)])
"""Undulations per revolution of each coefficient of `local_columns`."""


def local_difference(one: Seen, others: Others) -> Finding:
    """Judge local differences in 3 to 29 undulations."""
    # The limit is the sum of three parts: the ellipsoid of noise and known causes along the difference, a share of the
    # reversals' even undulations, and drift. A drift D over a turn is a sawtooth whose k-th undulation is D / (pi k).
    # Enough other pairs with larger differences widen the limit.
    against = others.opposite or others.earlier
    if against is None or one.analysis is None or against.analysis is None:
        return undecided(Name.LOCAL, "no other run of this test has been measured")
    if not (
        one.local_um.any() and against.local_um.any() and one.analysis.noise.known and against.analysis.noise.known
    ):
        return undecided(Name.LOCAL, "too few samples for undulations that are short")
    differs, counts = one.local_um - against.local_um, _compared(one, against)
    alike = one.run.circle.direction is against.run.circle.direction
    value = locally_apart_um(one, against)
    by_reversals = 0.0 if alike else OTHER_REVERSALS * norm_of(differs[(ORDERS > LOWEST) & ~counts])
    sawtooth = norm_of(1.0 / ORDERS[counts]) / (2.0 * np.pi)
    drifts = [
        abs(each.analysis.closure.height_um) for each in (one, against) if each.analysis and each.analysis.closure
    ]
    covariance = (one.u_um**2 + against.u_um**2) * np.eye(LOCAL_COEFFICIENTS)
    if one.run.expected is not None and against.run.expected is not None:
        covariance += apart_by(one.run.expected.local_um, against.run.expected.local_um, LOCAL_COEFFICIENTS)
    limit = sawtooth * sum(drifts) + by_reversals + limit_along(covariance[np.ix_(counts, counts)], differs[counts])
    if not alike and len(others.local_um) >= FEWEST_OTHERS:
        limit = max(limit, length_limit(others.local_um, SCATTERING))
    at_deg, height_um = _peak(np.where(ORDERS >= LOWEST, differs, 0.0))
    place = f"{height_um:+.1f} µm from run {against.run.label} at {at_deg:.0f} degrees"
    return found(
        Name.LOCAL,
        value,
        limit,
        f"nowhere does the path leave that of run {against.run.label}: at most {place}",
        f"the path is {place}: look for dirt between ball and cup and for what touches the bar there, and run both again",
        f"the path is {place}",
    )


def locally_apart_um(one: Seen, against: Seen) -> float:
    """Return the rms difference in the compared undulations [µm]."""
    return norm_of((one.local_um - against.local_um)[_compared(one, against)])


def _compared(one: Seen, against: Seen) -> Flags:
    alike = one.run.circle.direction is against.run.circle.direction
    return (ORDERS >= LOWEST) & (alike | (ORDERS % 2 == 1))


def _peak(differs_um: Floats) -> tuple[float, float]:
    theta_deg = np.arange(0.0, 360.0, 1.0)
    path = local_columns(np.radians(theta_deg)) @ differs_um
    top = place_of_largest(np.abs(path))
    return float(theta_deg[top]), float(path[top])
