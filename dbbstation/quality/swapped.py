"""Detect runs that show another test's circle: wrong bore, height, tilt, start or direction.

A bar does not measure its place. Likelihoods compare two normal distributions: one for the run's own circle, and one
for another test's circle, from that test's run or a model. A sound run favours another circle by a factor f with a
probability of at most 1 / f [Markov's inequality], in any dimension and usually far less.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.forms import SIZES
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN, length_quantile
from dbbstation.quality.stated import drifted_um, unseen_um2
from dbbstation.quality.together import expected_um, read_um
from dbbstation.trace.expected import COEFFICIENTS, along_travel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.quality.knowledge import Seen
    from dbbstation.quality.together import Together
    from dbbstation.trace.expected import Expected


@dataclass(frozen=True)
class _Explained:
    ratio: float
    fits: bool
    label: str


def of_its_test(one: Seen, both: Together | None) -> Finding:
    """Judge whether another circle of the plan explains the readings better."""
    every = [*_measured(one, both), *_predicted(one)]
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
        return undecided(Name.TEST, f"{better}: too alike to tell", value, limit)
    sound = f"none of {len(every)} other circles of the plan explains the readings better"
    return found(Name.TEST, value, limit, sound, better)


def _measured(one: Seen, both: Together | None) -> Iterator[_Explained]:
    if both is None:
        return
    as_own, without = both.log_likelihoods()
    # The size of machine errors is unknown: the own circle uses its best size, other circles the mean over sizes.
    common = float(logsumexp(without)) - float(np.log(len(SIZES))) - float(as_own.max())
    others = both.runs[1:]
    noise = np.array([[unseen_um2(one, other), drifted_um(one, other) ** 2] for other in others])
    alike = np.array([_again_um2(other) for other in others]) + noise[:, 0, None, None] * np.eye(COEFFICIENTS)
    alike[:, 0, 0] += noise[:, 1]
    apart = read_um(one) - np.array([read_um(other) for other in others])
    likelihoods, squares = _density(apart, alike)
    for other, likelihood, square in zip(others, likelihoods, squares, strict=True):
        yield _Explained(common + float(likelihood), _near(float(square)), f"run {other.run.label}")


def _again_um2(other: Seen) -> Floats:
    assert other.run.expected is not None  # noqa: S101 - chosen so
    signs = along_travel(other.run.circle)
    return signs[:, None] * other.run.expected.again_um2 * signs


def _predicted(one: Seen) -> Iterator[_Explained]:
    own = one.run.expected
    if own is None:
        return
    noise = unseen_um2(one, one) * np.eye(len(own.form_um))
    # A model does not contain today's drift, which may have continued at this turn's rate since the session began.
    noise[0, 0] += (one.drift_um_s * (one.run.started_s or 0.0)) ** 2
    as_own = read_um(one) - expected_um(one.run)
    likelihood, _ = _density(as_own, _whole(own, one.run.circle) + noise)
    for planned in one.run.planned:
        if planned.test == one.run.test:
            continue
        as_other = read_um(one) - expected_um(planned)
        covariance = _whole(planned.expected, planned.circle) + noise
        as_likely, square = _density(as_other, covariance)
        yield _Explained(float(as_likely - likelihood), _near(float(square)), f"test {planned.label}")


def _density(off: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    squares: Floats = np.sum(off * np.linalg.solve(covariance, off[..., None])[..., 0], axis=-1)
    return -0.5 * (np.linalg.slogdet(covariance)[1] + squares), squares


def _near(square: float) -> bool:
    return square <= length_quantile(COEFFICIENTS) ** 2


def _whole(expected: Expected, circle: Circle) -> Floats:
    effects = np.hstack([np.zeros((COEFFICIENTS, 1)), *expected.effects_um.values()])
    effects = along_travel(circle)[:, None] * effects
    return effects @ effects.T
