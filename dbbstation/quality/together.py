"""A run and those of other tests, as one normal variable: what all of them show of the machine, and where this circle should lie then.

Circles of one machine share its causes. What the circles of other tests read is therefore also known of this one, as far as the same
causes act on both: the conditional mean and covariance of a normal variable [Rasmussen and Williams, Gaussian Processes for Machine
Learning (2006), eq. 2.23 and 2.24]. How large this machine's errors are beside their usual size nobody knows; the other runs say it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.quality.forms import FIRST_COSINE, FIRST_SINE, SIZES, by_place, stacked
from dbbstation.quality.knowledge import COEFFICIENTS, along_travel
from dbbstation.quality.limits import FEWEST_OTHERS, median_length

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.quality.forms import Forms, Independent
    from dbbstation.quality.knowledge import Expected, Others, Planned, Run, Seen


@dataclass(frozen=True, eq=False)
class Together:
    """Runs of different tests beside one another; the first is the one that is judged."""

    runs: tuple[Seen, ...]
    first: Forms
    others: Forms

    @cached_property
    def apart(self) -> Independent:
        """The others in independent rows."""
        return self.others.apart()

    def log_likelihoods(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return those of all runs, and of all but the first, for each of SIZES, shape (9,) each."""
        whole = stacked([self.first, self.others]).apart()
        return whole.log_likelihoods()[:, 0], self.apart.log_likelihoods()[:, 0]


def together(one: Seen, others: Others) -> Together | None:
    """Return a run beside the runs of other tests; None where nothing is known of it, or no other test was measured."""
    them = [o for o in others.every if o.run.test != one.run.test and o.run.expected is not None]
    if one.run.expected is None or not them:
        return None
    runs = (one, *them)
    first, *rest = by_place(runs, [(read_um(each) - expected_um(each.run))[:, None] for each in runs])
    return Together(runs, first, stacked(rest))


def expected_beside(both: Together | None) -> Expected | None:
    """Return where the circle of the first run should lie, by what the runs of other tests show.

    The sizes of the machine's errors are weighed by the likelihood of the other runs. Where these differ from one another by more
    than they should, each test held against the rest [R. and W., section 5.4.2], the covariance grows with them: a machine may have
    causes that nobody named.

    Args:
        both: the runs; None gives None.
    """
    if both is None or (own := both.runs[0].run.expected) is None:
        return None
    of_others = both.apart.log_likelihoods()[:, 0]
    weights = np.exp(of_others - logsumexp(of_others))
    first, others = both.first, both.apart
    by_rest = first.rest @ others.rest.T
    by_machine = first.machine @ others.machine.T
    means, conditional = [], []
    for size in SIZES:
        across = size**2 * by_machine + by_rest
        gain = across / others.variances(float(size))
        means.append(gain @ others.off[:, 0])
        whole = np.eye(len(first.off)) + size**2 * first.machine @ first.machine.T + first.rest @ first.rest.T
        conditional.append(whole - gain @ across.T)
    mean = np.einsum("s,si->i", weights, means)
    scatter = np.array(means) - mean
    covariance = np.einsum("s,sij->ij", weights, conditional) + np.einsum("s,si,sj->ij", weights, scatter, scatter)
    covariance *= _straying(both.others, float(SIZES[int(np.argmax(of_others))])) ** 2
    root = both.first.root
    return _placed(own, both.runs[0].run.circle, root @ mean, root @ covariance @ root.T)


def _straying(others: Forms, size: float) -> float:
    """By how many times more than they should the other tests differ from what the rest of them show; one at the least."""
    of_test: dict[str, list[int]] = {}
    for row, test in enumerate(others.tests):
        of_test.setdefault(test, []).append(row)
    if len(of_test) < FEWEST_OTHERS:
        return 1.0
    columns = np.hstack([size * others.machine, others.rest])
    # With F = Q R of the columns above ones, the inverse of 1 + F F' is 1 - Q Q' [Woodbury].
    seen = np.linalg.qr(np.vstack([columns, np.eye(columns.shape[1])]))[0][: len(columns)]
    pulled = others.off[:, 0] - seen @ (seen.T @ others.off[:, 0])
    lengths = []
    for test, rows in of_test.items():
        # Of a test without the rest: residual e = B^-1 p, covariance B^-1, with B the test's block of the inverse and p its pull.
        block, pull = np.eye(len(rows)) - seen[rows] @ seen[rows].T, pulled[rows]
        lengths.append(float(np.sqrt(pull @ np.linalg.solve(block, pull))) / median_length(others.dimensions[test]))
    return max(float(np.median(lengths)), 1.0)


def _placed(
    own: Expected, circle: Circle, more_um: NDArray[np.float64], covariance_um2: NDArray[np.float64]
) -> Expected:
    """Return an expectation whose form, centre and mean reading are moved by a form along the travel [µm]."""
    start = np.radians(circle.start_deg)
    # A shift d along the bar at the start is sqrt 2 of a cosine's coefficient; a raised bar sees cos e of it.
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


def read_um(one: Seen) -> NDArray[np.float64]:
    """Return coefficients of the readings themselves, along the travel: bars and circles of another length are distinguished by the mean."""
    return along_travel(one.run.circle) * one.coefficients_um + _length_um(one.run.circle)


def expected_um(one: Run | Planned) -> NDArray[np.float64]:
    """Return the same as expected without other runs."""
    form = np.zeros(COEFFICIENTS) if one.expected is None else one.expected.form_um
    return along_travel(one.circle) * form + _length_um(one.circle)


def _length_um(circle: Circle) -> NDArray[np.float64]:
    length = np.zeros(COEFFICIENTS)
    length[0] = 1e3 * circle.bar_mm
    return length
