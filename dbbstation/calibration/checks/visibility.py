"""How well runs determine the machine: singular values, weak directions, observability indices, leverage.

The plan check tells whether the tests are redundant enough to reveal a wrong plan, and which tests would determine lost
directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from pydantic import computed_field

from dbbstation.calibration.fit.directions import in_words
from dbbstation.computing.arrays import place_of_largest, range_of, sum_of
from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.square_root import complement, lost_directions, spread_over

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.square_root import Block


WEAKEST = 3
"""Number of reported weak directions."""

STRONGEST = 5
"""Number of reported correlations."""


@dataclass(frozen=True)
class Indices:
    """Observability indices O1 to O5 for scaled parameters [Sun and Hollerbach, ICRA 2008, eqs 3 to 7].

    With singular values s_1 >= ... >= s_L of the sensitivity of n readings: O1 = (s_1 ... s_L)^(1/L) / sqrt(n), O2 =
    s_L / s_1, O3 = s_L, O4 = s_L^2 / s_1, O5 = 1 / (1/s_1 + ... + 1/s_L). All five grow with information.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float


@dataclass(frozen=True)
class WeakDirection:
    """A weakly determined direction.

    Attributes:
        uncertainty: standard uncertainty of its largest parameter along it.
        unit: µm for lengths of the geometry, else the parameter's unit.
    """

    text: str
    uncertainty: float
    unit: str


@dataclass(frozen=True)
class Correlation:
    """Two parameters that the runs hardly distinguish, each by source and name."""

    first: str
    second: str
    value: float


ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Observability:
    """How well circles determine the machine's parameters.

    Attributes:
        singular_values_mm: of the readings' sensitivity to parameters scaled by usual sizes, in descending order, without lost directions.
        indices: O1 to O5.
        leverage: each test's information, in numbers of parameters; without shared effects the sum is their total number.
    """

    singular_values_mm: tuple[float, ...]
    condition: float
    indices: Indices
    weak_directions: tuple[WeakDirection, ...]
    correlations: tuple[Correlation, ...]
    leverage: dict[str, float]


@with_one_thread
def visibility(calibration: Calibration) -> Observability:
    """Return the observability of a calibration."""
    fitted = calibration.layout.fitted
    scale = calibration.layout.known.scale[fitted]
    whole = spread_over(calibration.circle_blocks, fitted)[:, :-1] * scale
    free = complement(calibration.solution.held)
    singular = np.asarray(np.linalg.svd(whole @ free.T, compute_uv=False), dtype=np.float64)
    singular = singular[
        singular > ROUNDING * singular[0]
    ]  # circles contain no information on sources that change currents only
    readings = sum(block.count for block in calibration.circle_blocks)
    return Observability(
        singular_values_mm=tuple(singular.tolist()),
        condition=float(singular[0] / singular[-1]),
        indices=indices(singular, readings),
        weak_directions=_weakest(calibration),
        correlations=_correlations(calibration),
        leverage=_leverage(calibration, fitted),
    )


def indices(singular: Floats, readings: int) -> Indices:
    """Return O1 to O5 of positive singular values in descending order, shape (L,)."""
    greatest, least = float(singular[0]), float(singular[-1])
    return Indices(
        o1=float(np.exp(np.mean(np.log(singular)))) / sqrt(readings),
        o2=least / greatest,
        o3=least,
        o4=least**2 / greatest,
        o5=1.0 / sum_of(1.0 / singular),
    )


def _weakest(calibration: Calibration) -> tuple[WeakDirection, ...]:
    fitted = calibration.layout.fitted
    scale = calibration.layout.known.scale[fitted]
    scaled = calibration.solution.covariance[np.ix_(fitted, fitted)] / np.outer(scale, scale)
    variance, axes = np.linalg.eigh(scaled)
    units = [parameter.unit for parameter in calibration.layout.parameters]
    found = []
    for k in range(len(fitted) - 1, len(fitted) - 1 - min(WEAKEST, calibration.parameters_identified), -1):
        moved = scale * axes[:, k]
        # Units differ, so compare parameters in units of their usual sizes.
        most = place_of_largest(np.abs(axes[:, k]))
        size, unit = float(np.sqrt(variance[k]) * np.abs(moved[most])), units[fitted[most]]
        size, unit = (1e3 * size, "µm") if unit == "mm" else (size, unit)
        found.append(WeakDirection(in_words(calibration.layout, axes[None, :, k])[0], size, unit))
    return tuple(found)


def _correlations(calibration: Calibration) -> tuple[Correlation, ...]:
    fitted = calibration.layout.fitted
    covariance = calibration.solution.covariance[np.ix_(fitted, fitted)]
    sigma = np.sqrt(np.diag(covariance))
    fitted, covariance, sigma = fitted[sigma > 0.0], covariance[np.ix_(sigma > 0.0, sigma > 0.0)], sigma[sigma > 0.0]
    names = [f"{source} {parameter}" for source, _, parameter in calibration.layout.names]
    value = covariance / np.outer(sigma, sigma)
    first, second = np.triu_indices(len(fitted), 1)
    order = np.argsort(-np.abs(value[first, second]))[:STRONGEST]
    return tuple(
        Correlation(names[fitted[i]], names[fitted[j]], float(value[i, j]))
        for i, j in zip(first[order], second[order], strict=True)
    )


def _leverage(calibration: Calibration, fitted: Integers) -> dict[str, float]:
    """Return, per test, the trace of covariance times the test's information, after elimination of its random effects."""
    # The trace approximates the number of parameters lost without the test. Effects shared with other tests, such as
    # the bar's length, count as unknowns.
    known, noise = calibration.layout.known, calibration.noise.effective
    runs = zip(calibration.observations, calibration.circle_blocks, strict=True)
    tests = grouped((run.test, block) for run, block in runs)
    touched = {test: np.unique(np.concatenate([block.columns for block in blocks])) for test, blocks in tests.items()}
    times = np.bincount(np.concatenate(list(touched.values())), minlength=len(known.random))
    common = np.concatenate([fitted, np.flatnonzero(known.random & (times > 1))])
    covariance = calibration.solution.covariance[np.ix_(common, common)]
    worth: dict[str, float] = {}
    for test, blocks in tests.items():
        own = np.setdiff1d(touched[test], common)
        priors = np.hstack([np.diag(1.0 / known.prior[own]), np.zeros((len(own), len(common)))])
        rows = spread_over(blocks, np.concatenate([own, common]))[:, :-1] / noise
        triangle = np.asarray(np.linalg.qr(np.vstack([priors, rows]), mode="r"), dtype=np.float64)
        root = triangle[len(own) :, len(own) :]
        worth[test] = sum_of((root @ covariance) * root)
    return worth


@dataclass(frozen=True)
class PlanCheck:
    """Redundancy of the tests."""

    tests: int
    determined: int
    identified: int
    of_one_test: int

    @computed_field  # type: ignore[prop-decorator]
    @property
    def left(self) -> int:
        """Return the remaining degrees of freedom."""
        return self.determined - self.identified

    @computed_field  # type: ignore[prop-decorator]
    @property
    def enough(self) -> bool:
        """Return whether the tests can show a wrong plan."""
        return self.left >= self.of_one_test


@with_one_thread
def check_plan(calibration: Calibration) -> PlanCheck:
    """Count the directions that tests determine at the fit's noise, without tolerances of the machine file."""
    free, fitted = calibration.layout.unbounded, len(calibration.layout.fitted)

    def determined(blocks: Sequence[Block]) -> int:
        return fitted - len(lost_directions(blocks, free, calibration.noise.effective))

    runs = zip(calibration.observations, calibration.circle_blocks, strict=True)
    by_test = grouped(((run.setup.session, run.test), block) for run, block in runs)
    each = [determined(blocks) for blocks in by_test.values()]
    return PlanCheck(len(each), sum(each), determined(calibration.circle_blocks), max(each))


APART_MM = 20.0
"""Smaller height differences count as one height [mm]."""

TILTED_DEG = 2.0
"""Smaller orientation differences count as one orientation [deg]."""


def gaps(calibration: Calibration) -> tuple[str, ...]:
    """Return texts on the measurements that would determine lost directions; may be empty."""
    # The fifteen circles of [CAL Table II] lose only the common height, which raised bars determine. Circles at one
    # height lose three directions; circles in one orientation lose most of the others.
    lost = len(calibration.directions_lost) + len(calibration.directions_regularised)
    if lost == 0:
        return ()
    runs = calibration.observations
    if any(not run.setup.place_known for run in runs):
        return ("balls put up under the spindle say nothing of the machine's place and tilt on the table",)
    found = []
    if lost > 1 and range_of([run.raw.circle.ball_mm[2] for run in runs]) < APART_MM:
        found.append("the balls of all tests stand at one height: add tests on a longer holder, at two more levels")
    if lost > 1 and float(np.ptp([run.raw.circle.tilt_deg for run in runs], axis=0).max()) < TILTED_DEG:
        found.append("all tests have one orientation: add tests with the platform tilted by 10 degrees or more")
    if lost > 1 and not found:
        tests = len({(run.setup.session, run.test) for run in runs})
        found.append(
            f"{tests} tests lose {lost} directions where the fifteen circles of the jig plan lose one: add places, "
            "levels and tilts"
        )
    if all(run.raw.circle.elevation_deg == 0.0 for run in runs):
        found.append("no test has a raised bar: five with elevation_deg: 5 show the height of the machine too")
    return tuple(found)
