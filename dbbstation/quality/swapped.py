"""Whether a run shows the circle of its own test, or that of another: wrong bore, height, tilt, start or direction of the program.

A bar reads a length and no place: the circle of another test looks as sound as its own. Two explanations of the same readings
are compared by their likelihoods, which are normal: the run is its own circle, whose form is uncertain by all that is uncertain of
machine and set-up; or it is the circle of another test, which a run of that test or a model shows. The chance that a sound run
favours another explanation by a factor of f or more is 1 / f at the most [Markov's inequality], whatever the number of dimensions;
it is less by far, so that the bound may be the probability of any finding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.quality.finding import Finding, FindingVerdict, Name, found, undecided
from dbbstation.quality.knowledge import COEFFICIENTS, along_travel
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN, length_quantile
from dbbstation.quality.stated import drifted_um, unseen_um2

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from dbbstation.plan.circle import Circle
    from dbbstation.quality.knowledge import Expected, Others, Planned, Run, Seen


@dataclass(frozen=True)
class _Explained:
    """How much better another circle explains a run.

    Attributes:
        ratio: logarithm of the likelihood as the other circle over that as its own.
        fits: whether the run is as near the other circle as a run of it would be.
        label: of the other circle.
    """

    ratio: float
    fits: bool
    label: str


def of_its_test(one: Seen, others: Others) -> Finding:
    """Return whether another circle of the plan explains the readings better than the circle of the run's own test."""
    every = [*_measured(one, others), *_predicted(one)]
    if not every:
        return undecided(
            Name.TEST, "no other circle of the plan has been measured, and no model says what they look like"
        )
    limit = float(np.log(len(every) / FALSE_ALARMS_PER_RUN))
    fitting = [each for each in every if each.fits]
    nearest = max(fitting or every, key=lambda each: each.ratio)
    value = max(nearest.ratio, 0.0) if fitting else 0.0
    times = "over a million" if value > np.log(1e6) else f"{np.exp(value):.0f}"
    own = f"{one.run.test} {one.run.circle.direction}"
    better = f"the readings are {times} times as likely those of {nearest.label} as those of {own}"
    if 0.0 < value <= limit:
        return Finding(Name.TEST, value, limit, "", FindingVerdict.CANNOT_TELL, f"{better}: too alike to tell")
    sound = f"none of {len(every)} other circles of the plan explains the readings better"
    return found(
        Name.TEST,
        value,
        limit,
        "",
        sound,
        f"{better}: check bore, holder, tilt, start and program of both, and run it again",
    )


def _measured(one: Seen, others: Others) -> Iterator[_Explained]:
    """Circles of other tests that were measured; what they show of the machine says what the run's own circle should look like."""
    them = [o for o in others.every if o.run.test != one.run.test and o.run.expected is not None]
    if one.run.expected is None or not them:
        return
    runs = [one, *them]
    off = np.concatenate([_read(each) - _absolute(each.run) for each in runs])
    machine, rest = _together(runs)
    n = len(one.coefficients_um)
    as_own = [_log_likelihood(off, size**2 * machine + rest) for size in SIZES]
    without = [_log_likelihood(off[n:], (size**2 * machine + rest)[n:, n:]) for size in SIZES]
    # How large this machine's errors are nobody knows: the size that suits the run's own circle best, against the mean of all.
    common = float(logsumexp(without)) - float(np.log(len(SIZES))) - max(as_own)
    for other in them:
        assert other.run.expected is not None  # noqa: S101 - chosen so
        signs = along_travel(other.run.circle)
        alike = signs[:, None] * other.run.expected.again_um2 * signs + unseen_um2(one, other) * np.eye(n)
        alike[0, 0] += drifted_um(one, other) ** 2
        apart = _read(one) - _read(other)
        yield _Explained(common + _log_likelihood(apart, alike), _fits(apart, alike), f"run {other.run.label}")


SIZES = np.geomspace(0.03, 3.0, 9)
"""Errors of a machine as shares of their usual or stated size: from one calibrated to hundredths of a millimetre to one put together
without care."""


def _together(runs: Sequence[Seen]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance of the forms of n runs along their travel, by the machine's causes and by all else, shape (7 n, 7 n) each [µm²]."""
    n = len(runs[0].coefficients_um)
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
    own = np.repeat([0.5 * unseen_um2(each, each) for each in runs], n)
    return machine, rest + np.diag(own)


def _effects(one: Seen) -> dict[tuple[str, str], NDArray[np.float64]]:
    signs = along_travel(one.run.circle)
    effects = {} if one.run.expected is None else one.run.expected.effects_um
    return {key: signs[:, None] * effect for key, effect in effects.items()}


def _predicted(one: Seen) -> Iterator[_Explained]:
    """Circles of the plan as a model has them."""
    own = one.run.expected
    if own is None:
        return
    noise = unseen_um2(one, one) * np.eye(len(own.form_um))
    as_own = _read(one) - _absolute(one.run)
    likelihood = _log_likelihood(as_own, _whole(own, one.run.circle) + noise)
    for planned in one.run.planned:
        if planned.test == one.run.test:
            continue
        as_other = _read(one) - _absolute(planned)
        covariance = _whole(planned.expected, planned.circle) + noise
        ratio = _log_likelihood(as_other, covariance) - likelihood
        yield _Explained(ratio, _fits(as_other, covariance), f"test {planned.label}")


def _fits(off: NDArray[np.float64], covariance: NDArray[np.float64]) -> bool:
    return float(off @ np.linalg.solve(covariance, off)) <= length_quantile(len(off)) ** 2


def _log_likelihood(off: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Logarithm of a normal density, without the constant that all have."""
    _, log_determinant = np.linalg.slogdet(covariance)
    return -0.5 * (float(log_determinant) + float(off @ np.linalg.solve(covariance, off)))


def _read(one: Seen) -> NDArray[np.float64]:
    """Coefficients of the readings themselves, along the travel: bars and circles of another length are distinguished by the mean."""
    return along_travel(one.run.circle) * one.coefficients_um + _length_um(one.run.circle)


def _absolute(one: Run | Planned) -> NDArray[np.float64]:
    """The same as expected."""
    form = np.zeros(COEFFICIENTS) if one.expected is None else one.expected.form_um
    return along_travel(one.circle) * form + _length_um(one.circle)


def _length_um(circle: Circle) -> NDArray[np.float64]:
    length = np.zeros(COEFFICIENTS)
    length[0] = 1e3 * circle.bar_mm
    return length


def _whole(expected: Expected, circle: Circle) -> NDArray[np.float64]:
    """Covariance of a form along its travel by all causes."""
    effects = np.hstack([np.zeros((COEFFICIENTS, 1)), *expected.effects_um.values()])
    effects = along_travel(circle)[:, None] * effects
    return effects @ effects.T
