"""Joint normal distribution of a run and the runs of other tests, and the circle's expectation from them.

Circles share the machine's causes, so the others' readings condition this circle [Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), eq. 2.23 and 2.24]. They also determine the size of this machine's errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, chdtri, logsumexp

from dbbstation.computing.arrays import median_of, place_of_largest
from dbbstation.computing.grouped import grouped
from dbbstation.quality.forms import FIRST_COSINE, FIRST_SINE
from dbbstation.quality.limits import FEWEST_OTHERS, SHARE, median_length
from dbbstation.trace.expected import COEFFICIENTS, along_travel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.plan.plan import Circle
    from dbbstation.quality.forms import Forms, FormsBesides
    from dbbstation.quality.knowledge import Planned, Run, Seen
    from dbbstation.trace.expected import Expected


@dataclass(frozen=True, eq=False)
class Together:
    """Runs of different tests, of which the first is judged.

    Attributes:
        rows: row numbers of each other test among the stored forms.
        apart_um: form of the first run minus its prediction by the others, for each of SIZES, shape (9, 7) [µm].
        covariance_um2: of that difference, shape (9, 7, 7) [µm²].
    """

    runs: tuple[Seen, ...]
    others: FormsBesides
    rows: Mapping[str, Integers]
    apart_um: Floats
    covariance_um2: Floats

    def log_likelihoods(self) -> tuple[Floats, Floats]:
        """Return log likelihoods of all runs, and of all runs but the first, for each of SIZES, shape (9,) each."""
        of_others = self.others.log_likelihoods()[:, 0]
        pulls = np.linalg.solve(self.covariance_um2, self.apart_um[:, :, None])[:, :, 0]
        squares = np.sum(self.apart_um * pulls, axis=1)
        return of_others - 0.5 * (squares + np.linalg.slogdet(self.covariance_um2)[1]), of_others


def together(one: Seen, runs: Sequence[Seen], forms: Forms) -> Together | None:
    """Return a run with the runs of other tests; None without expectation or other tests.

    Args:
        forms: of this session's runs; the first column contains the forms as planned.
    """
    known = [other for other in runs if other.run.expected is not None]
    them = [other for other in known if other.run.test != one.run.test]
    if one.run.expected is None or not them:
        return None
    forms.hold([(each,) for each in known])
    others = forms.part([(each,) for each in them], (one,))
    of_test = grouped((each.run.test, (each,)) for each in them)
    apart_um, covariance_um2 = others.beside((one,))
    rows = {test: forms.rows(each) for test, each in of_test.items()}
    return Together((one, *them), others, rows, apart_um[:, :, 0], covariance_um2)


def expected_beside(both: Together | None) -> Expected | None:
    """Return the first run's expected circle given the others.

    Args:
        both: from `together`; None gives None.
    """
    # Sizes of machine errors are weighted by likelihood. Each other test is compared with its prediction by the
    # remaining tests [R. and W., section 5.4.2]. If they disagree, causes may be missing, so the covariance grows.
    if both is None or (own := both.runs[0].run.expected) is None:
        return None
    of_others = both.others.log_likelihoods()[:, 0]
    weights = np.exp(of_others - logsumexp(of_others))
    apart = np.einsum("s,si->i", weights, both.apart_um)
    scatter = both.apart_um - apart
    covariance = np.einsum("s,sij->ij", weights, both.covariance_um2)
    covariance += np.einsum("s,si,sj->ij", weights, scatter, scatter)
    covariance *= _straying(both, place_of_largest(of_others)) ** 2 * _tail(weights, both.covariance_um2)
    one = both.runs[0]
    return _placed(own, one.run.circle, read_um(one) - expected_um(one.run) - apart, covariance)


def _tail(weights: Floats, covariances_um2: Floats) -> float:
    """Return the factor on the mean covariance that accounts for the longer tails of a mixture of sizes."""
    from scipy.optimize import brentq  # noqa: PLC0415 - takes a fifth of a second; only judging by a model needs it

    # A sound circle exceeds the scaled ellipsoid with probability SHARE. The mixed covariances are assumed to be
    # proportional.
    sizes = np.trace(covariances_um2, axis1=1, axis2=2)
    sizes /= weights @ sizes
    normal = float(chdtri(COEFFICIENTS, SHARE))
    farthest = normal * max(float(sizes.max()), 1.0)
    found = brentq(lambda square: float(weights @ chdtrc(COEFFICIENTS, square / sizes)) - SHARE, 0.0, farthest)
    return max(float(found) / normal, 1.0)


def _straying(both: Together, size: int) -> float:
    if len(both.rows) < FEWEST_OTHERS:
        return 1.0
    lengths = [both.others.length_without(size, rows) / median_length(len(rows)) for rows in both.rows.values()]
    return max(median_of(lengths), 1.0)


def _placed(own: Expected, circle: Circle, more_um: Floats, covariance_um2: Floats) -> Expected:
    start = np.radians(circle.start_deg)
    # A shift along the bar at the start is sqrt 2 times the cosine's coefficient; a raised bar measures cos e times the
    # shift.
    along = np.sqrt(2.0) * circle.bar_mm / circle.radius_mm
    turned = along * np.array([[np.cos(start), -np.sin(start)], [np.sin(start), np.cos(start)]])
    to_place = np.zeros((3, COEFFICIENTS))
    to_place[:2, [FIRST_COSINE, FIRST_SINE]] = turned
    to_place[2, 0] = 1.0
    signs = along_travel(circle)
    to_place *= 1e-3 * signs
    off_mm = to_place @ more_um
    return replace(
        own,
        form_um=own.form_um + signs * more_um,
        known_um2=signs[:, None] * covariance_um2 * signs,
        centre_mm=own.centre_mm + off_mm[:2],
        radial_mm=own.radial_mm + float(off_mm[2]),
        covariance_mm2=to_place @ covariance_um2 @ to_place.T,
    )


def read_um(one: Seen) -> Floats:
    """Return coefficients of the readings along the travel; their mean contains the bar length."""
    return read_along_um(one.run.circle, one.coefficients_um)


def read_along_um(circle: Circle, form_um: Floats) -> Floats:
    """Return coefficients as `read_um` does, for a form on a circle, shape (7,) [µm]."""
    return along_travel(circle) * form_um + _length_um(circle)


def expected_um(one: Run | Planned) -> Floats:
    """Return coefficients as `read_um` does, as expected without other runs."""
    form = np.zeros(COEFFICIENTS) if one.expected is None else one.expected.form_um
    return along_travel(one.circle) * form + _length_um(one.circle)


def _length_um(circle: Circle) -> Floats:
    length = np.zeros(COEFFICIENTS)
    length[0] = 1e3 * circle.bar_mm
    return length
