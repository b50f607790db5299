"""A run and those of other tests, as one normal variable: what all of them show of the machine, and where this circle should lie then.

Circles of one machine share its causes. What the circles of other tests read is therefore also known of this one, as far as the same
causes act on both: the conditional mean and covariance of a normal variable [Rasmussen and Williams, Gaussian Processes for Machine
Learning (2006), eq. 2.23 and 2.24]. How large this machine's errors are beside their usual size nobody knows; the other runs say it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.quality.knowledge import COEFFICIENTS, HIGHEST_HARMONIC, along_travel
from dbbstation.quality.limits import FEWEST_OTHERS, median_length
from dbbstation.quality.stated import unseen_um2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.quality.knowledge import Expected, Others, Planned, Run, Seen

SIZES = np.geomspace(0.03, 3.0, 9)
"""Errors of a machine as shares of their usual or stated size: from one calibrated to hundredths of a millimetre to one put together
without care."""

FIRST_COSINE, FIRST_SINE = 1, HIGHEST_HARMONIC + 1
"""Coefficients of one undulation, which a shift of the circle makes."""

ANYWHERE_UM = 1e4
"""Standard deviation of the centre of a circle whose ball was put up under the spindle: it says nothing [µm]."""


@dataclass(frozen=True, eq=False)
class Together:
    """Runs of different tests beside one another; the first is the one that is judged.

    Attributes:
        runs: n runs.
        off_um: form of each along its travel, less the one that is expected without other runs, shape (7 n,) [µm].
        machine_um2: its covariance by the machine's causes at their usual or stated size, shape (7 n, 7 n) [µm²].
        rest_um2: its covariance by all else, likewise.
    """

    runs: tuple[Seen, ...]
    off_um: NDArray[np.float64]
    machine_um2: NDArray[np.float64]
    rest_um2: NDArray[np.float64]

    def covariance_um2(self, size: float) -> NDArray[np.float64]:
        """Return the covariance of a machine whose errors are so many times their usual size, shape (7 n, 7 n) [µm²]."""
        return size**2 * self.machine_um2 + self.rest_um2

    def log_likelihoods(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return those of all runs, and of all but the first, for each of SIZES, shape (9,) each."""
        whole = [log_likelihood(self.off_um, self.covariance_um2(size)) for size in SIZES]
        n = COEFFICIENTS
        others = [log_likelihood(self.off_um[n:], self.covariance_um2(size)[n:, n:]) for size in SIZES]
        return np.array(whole), np.array(others)


def together(one: Seen, others: Others) -> Together | None:
    """Return a run beside the runs of other tests; None where nothing is known of it, or no other test was measured."""
    them = [o for o in others.every if o.run.test != one.run.test and o.run.expected is not None]
    if one.run.expected is None or not them:
        return None
    runs = (one, *them)
    off = np.concatenate([read_um(each) - expected_um(each.run) for each in runs])
    machine, rest = covariances(runs)
    return Together(runs, off, machine, rest)


def covariances(runs: Sequence[Seen]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance of the forms of n runs along their travel, by the machine's causes and by all else, shape (7 n, 7 n) each [µm²]."""
    n = COEFFICIENTS
    machine, rest = np.zeros((n * len(runs), n * len(runs))), np.zeros((n * len(runs), n * len(runs)))
    effects = [_effects(each) for each in runs]
    for key in dict.fromkeys(key for each in effects for key in each):
        width = max(each[key].shape[1] for each in effects if key in each)
        stacked = np.vstack([each.get(key, np.zeros((n, width))) for each in effects])
        if key[1]:
            rest += stacked @ stacked.T
        else:
            machine += stacked @ stacked.T
    # What the overlaps show of a drift may have gone on through the session.
    rate = float(np.sqrt(np.mean([each.drift_um_s**2 for each in runs])))
    drift = np.concatenate([rate * (each.run.started_s or 0.0) * np.eye(n)[0] for each in runs])
    rest += np.outer(drift, drift)
    own = np.concatenate([own_um2(each) for each in runs])
    return machine, rest + np.diag(own)


def own_um2(one: Seen) -> NDArray[np.float64]:
    """Variance of each coefficient that a run shares with no other, shape (7,) [µm²]."""
    own = np.full(COEFFICIENTS, 0.5 * unseen_um2(one, one))
    if one.run.expected is not None and not one.run.expected.place_known:
        own[[FIRST_COSINE, FIRST_SINE]] += ANYWHERE_UM**2
    return own


def _effects(one: Seen) -> dict[tuple[str, str], NDArray[np.float64]]:
    signs = along_travel(one.run.circle)
    effects = {} if one.run.expected is None else one.run.expected.effects_um
    return {key: signs[:, None] * effect for key, effect in effects.items()}


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
    n = COEFFICIENTS
    _, of_others = both.log_likelihoods()
    weights = np.exp(of_others - logsumexp(of_others))
    means, conditional = [], []
    for size in SIZES:
        whole = both.covariance_um2(size)
        gain = np.linalg.solve(whole[n:, n:], whole[n:, :n]).T
        means.append(gain @ both.off_um[n:])
        conditional.append(whole[:n, :n] - gain @ whole[n:, :n])
    mean = np.einsum("s,si->i", weights, means)
    scatter = np.array(means) - mean
    covariance = np.einsum("s,sij->ij", weights, conditional) + np.einsum("s,si,sj->ij", weights, scatter, scatter)
    covariance *= _straying(both, float(SIZES[int(np.argmax(of_others))])) ** 2
    return _placed(own, both.runs[0].run.circle, mean, covariance)


def _straying(both: Together, size: float) -> float:
    """By how many times more than they should the other tests differ from what the rest of them show; one at the least."""
    n = COEFFICIENTS
    inverse = np.linalg.inv(both.covariance_um2(size)[n:, n:])
    pulled = inverse @ both.off_um[n:]
    of_test: dict[str, list[int]] = {}
    for k, each in enumerate(both.runs[1:]):
        of_test.setdefault(each.run.test, []).extend(range(n * k, n * k + n))
    if len(of_test) < FEWEST_OTHERS:
        return 1.0
    lengths = []
    for rows in of_test.values():
        # Of a test without the rest: residual e = B^-1 p, covariance B^-1, with B the test's block of the inverse and p its pull.
        block, pull = inverse[np.ix_(rows, rows)], pulled[rows]
        lengths.append(float(np.sqrt(pull @ np.linalg.solve(block, pull))) / median_length(len(rows)))
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


def log_likelihood(off: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Return the logarithm of a normal density, without the constant that all have."""
    _, log_determinant = np.linalg.slogdet(covariance)
    return -0.5 * (float(log_determinant) + float(off @ np.linalg.solve(covariance, off)))


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
