"""Compare a circle's radius, place and form with expectation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of, norm_of
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.forms import own_um2
from dbbstation.quality.limits import quantile
from dbbstation.quality.stated import limit_along
from dbbstation.trace.cut import FEED_SIGMAS
from dbbstation.trace.expected import HIGHER

if TYPE_CHECKING:
    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.quality.knowledge import Seen
    from dbbstation.trace.expected import Expected


def radius(one: CircleAnalysis, expected: Expected | None, by: str = "") -> Finding:
    """Judge the mean reading.

    At the programmed feed a larger circle takes longer. If the overlap shows this, no expectation is needed.
    """
    if (larger := _turns_slower(one)) is not None:
        return larger
    if expected is None:
        return undecided(Name.RADIUS, "no expected radius is known")
    off_um = one.mean_radial_error_um - 1e3 * expected.radial_mm
    u_um = hypot_of(1e3 * np.sqrt(expected.covariance_mm2[2, 2]), one.noise.sigma_um / np.sqrt(len(one.raw)))
    stated = (
        f"the bar reads {one.mean_radial_error_um:+.1f} µm on average, expected {1e3 * expected.radial_mm:+.1f} µm{by}"
    )
    return found(Name.RADIUS, abs(off_um), quantile(np.inf) * u_um, stated)


def _turns_slower(one: CircleAnalysis) -> Finding | None:
    circle, mean_um = one.raw.circle, one.mean_radial_error_um
    if one.feed_mm_min is None:
        return None
    shown, u = one.feed_mm_min
    slower_um, u_um = 1e3 * circle.bar_mm * (circle.feed_mm_min / shown - 1.0), 1e3 * circle.bar_mm * u / shown
    limit = FEED_SIGMAS * u_um
    if abs(slower_um) <= limit or abs(slower_um - mean_um) > limit or abs(mean_um) <= limit:
        return None
    stated = f"the bar reads {mean_um:+.1f} µm on average, and the circle turns slower by {slower_um:+.0f} ± {u_um:.0f} µm of its radius"
    return found(Name.RADIUS, abs(mean_um), limit, stated, short=f"radius {1e-3 * mean_um:+.2f} mm")


def bore(one: CircleAnalysis, expected: Expected | None, by: str = "") -> Finding:
    """Judge the centre."""
    if expected is None:
        return undecided(Name.BORE, "no expected centre is known")
    if not expected.place_known:
        return undecided(Name.BORE, "the ball was put up under the spindle: its place is not known")
    off_um = 1e3 * (np.array(one.centre_mm) - expected.centre_mm)
    noise = 2.0 * one.noise.sigma_um**2 / len(one.raw)
    covariance = 1e6 * expected.covariance_mm2[:2, :2] + noise * np.eye(2)
    # The limit is the sound centre's ellipse, in the direction of this deviation.
    size, limit = norm_of(off_um), limit_along(covariance, off_um)
    stated = (
        f"the centre is {size:.1f} µm from where it is expected{by}, {off_um[0]:+.1f} in X and {off_um[1]:+.1f} in Y"
    )
    return found(Name.BORE, size, limit, stated)


def form(one: Seen, expected: Expected | None, by: str = "") -> Finding:
    """Judge mean, centre, ellipse and triangle together."""
    if expected is None:
        return undecided(Name.FORM, "no expected form is known")
    covariance = expected.known_um2
    if covariance is None:
        effects = np.hstack([np.zeros((len(expected.form_um), 1)), *expected.effects_um.values()])
        covariance = effects @ effects.T + np.diag(own_um2(one))
    # The centre of a ball set up under the spindle contains no information.
    rows = list(range(len(expected.form_um))) if expected.place_known else [0, *HIGHER]
    off = (one.coefficients_um - expected.form_um)[rows]
    value, limit = norm_of(off), limit_along(covariance[np.ix_(rows, rows)], off)
    stated = f"{value:.1f} µm rms from where mean, centre, ellipse and triangle are expected{by}"
    return found(Name.FORM, value, limit, stated)
