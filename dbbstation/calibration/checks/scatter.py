"""Compare what a fit leaves with its noise, and the fitted scatter of balls and bar with the stated one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.computing.arrays import sum_of
from dbbstation.computing.grouped import grouped
from dbbstation.inference.harmonics import LOW, Misfit, misfit, smooth
from dbbstation.inference.left_over import Remainder, remainder
from dbbstation.trace.recording import means, sector_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.harmonics import Spectrum


DETERMINED = 0.5
"""Share of a coordinate's stated variance that the runs must remove before it counts as determined."""

CONFIDENCE = 0.95
"""Coverage of the interval of the balls' scatter. It reports excess scatter for 25 of 1000 sound groups; 99 % would
give 5. With ten determined coordinates it detects 1.5 times the stated scatter in 52 of 100 sessions, at 99 % in 34
(from chi-square)."""

UNKNOWN_MM = 1.0
"""Prior standard deviation of a ball at an unknown place, in the plane that a level bar measures [mm]."""

LEAST_STATED_MM = 0.1
"""Larger prior standard deviations do not describe a holder, but a freed ball or a ball set up by hand [mm]."""


@dataclass(frozen=True, eq=False)
class MountingOffset:
    """A ball's place in one mounting, mounting and CMM errors combined.

    Attributes:
        stated_mm: standard deviation of each coordinate, shape (3,) [mm].
        shift_mm: best prediction, machine axes, shape (3,) [mm].
        spread_mm2: its covariance, shape (3, 3) [mm²].
        square: sum of squared determined coordinates, each over its expected variance.
    """

    mounting: str
    ball: str
    stated_mm: Floats
    shift_mm: Floats
    spread_mm2: Floats
    square: float
    freedom: int


class ScatterVerdict(StrEnum):
    """Verdict on the scatter of balls."""

    AS_STATED = "as-stated"
    MORE = "more"
    LESS = "less"
    UNTOLD = "untold"


@dataclass(frozen=True)
class ScatterCheck:
    """Comparison of the scatter of balls that have one stated size.

    Attributes:
        stated_um: standard deviation per axis, mounting and CMM combined.
        interval_um: 95 % interval of the standard deviation; None if undetermined.
        fits: whether they scatter no more than stated; None if undetermined.
        finding: position of the stated size relative to the interval.
    """

    stated_um: float
    found_um: float | None
    interval_um: tuple[float, float] | None
    mountings: int
    fits: bool | None
    finding: ScatterVerdict


def seats_of(calibration: Calibration) -> list[MountingOffset]:
    """Return every ball's place, with a chi-square for its displacement."""
    # A best linear unbiased prediction m with stated covariance P and remaining covariance V has the covariance P - V
    # [Henderson, Biometrics 31 (1975) 423]. Over the determined coordinates m (P - V)^-1 m is chi-square.
    layout, covariance = calibration.layout, calibration.solution.covariance
    terms = {(term.source.name, term.shared): term for term in layout.terms}
    seats = []
    for setup in {o.setup.mounting: o.setup for o in calibration.observations}.values():
        parts = [terms.get(("mounting", setup.mounting)), terms.get(("ball-coordinate", setup.ball))]
        columns = [np.r_[term.columns] for term in parts if term is not None]
        if not columns:
            continue
        stated = sum(layout.known.prior[own] ** 2 for own in columns)
        shift = sum(calibration.x[own] for own in columns)
        left = sum(covariance[np.ix_(a, b)] for a in columns for b in columns)
        size = np.sqrt(np.asarray(stated))
        # In units of stated sizes, directions with eigenvalues near one are determined by the runs, near zero by the
        # plan alone.
        share, axes = np.linalg.eigh(np.eye(3) - np.asarray(left) / np.outer(size, size))
        known = share > DETERMINED
        along = (axes.T @ (np.asarray(shift) / size))[known]
        seats.append(
            MountingOffset(
                mounting=setup.mounting,
                ball=setup.ball,
                stated_mm=size,
                shift_mm=np.asarray(shift),
                spread_mm2=np.asarray(left),
                square=sum_of(along**2 / share[known]),
                freedom=int(np.count_nonzero(known)),
            )
        )
    return seats


def check_scatter(seats: Sequence[MountingOffset]) -> list[ScatterCheck]:
    """Compare found and stated scatter by stated size."""
    # The sum of squares over the true variance is chi-square. Errors of the fitted machine are common to neighbouring
    # balls, which makes the interval slightly too narrow for few balls.
    known = (seat for seat in seats if seat.stated_mm[0] < LEAST_STATED_MM)
    groups = grouped((round(1e3 * float(seat.stated_mm[0]), 3), seat) for seat in known)
    return [_checked(stated_um, group) for stated_um, group in sorted(groups.items())]


def _checked(stated_um: float, group: Sequence[MountingOffset]) -> ScatterCheck:
    square, freedom = sum(seat.square for seat in group), sum(seat.freedom for seat in group)
    if freedom == 0:
        return ScatterCheck(stated_um, None, None, len(group), None, ScatterVerdict.UNTOLD)
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = (stated_um * sqrt(square / chdtri(freedom, p)) for p in (tail, 1.0 - tail))
    within = ScatterVerdict.LESS if high < stated_um else ScatterVerdict.AS_STATED
    finding = ScatterVerdict.MORE if low > stated_um else within
    found_um = stated_um * sqrt(square / freedom)
    return ScatterCheck(stated_um, found_um, (low, high), len(group), finding is not ScatterVerdict.MORE, finding)


def fine_noise_mm(calibration: Calibration) -> float:
    """Return a reading's noise, estimated above the harmonics of smooth misfit [mm]."""
    square, count = 0.0, 0.0
    for observation, residual in zip(calibration.observations, calibration.residual_mm, strict=True):
        rough = residual - smooth(residual, np.radians(observation.raw.phi_deg))
        square += float(rough @ rough)
        count += max(len(rough) - (2 * LOW + 1), 1)
    return sqrt(square / count)


SIGNIFICANT = 1e-8
"""Probability below which a residual counts as missing physics. The F test estimates noise at high harmonics.
Correlated samples may lower this estimate by a sixth, which alone gives 1e-6. The limit hardly matters: on the fifteen
circles with noise of 0.5 µm, a gravity residual of 0.06 µm rms gives 1e-3, and 0.26 µm gives less than 1e-99."""

SECTORS = 720
"""Most sectors per turn for averaging residuals, enough for all tested harmonics."""


def misfit_of(calibration: Calibration, noise: Spectrum | None = None) -> Misfit:
    """Return an F test of the residual's low harmonics, after removal of a ball position per mounting."""
    return misfit(*_by_sector(calibration), calibration.parameters_identified, noise)


def remainder_of(calibration: Calibration, noise: Spectrum) -> Remainder:
    """Return the largest harmonic, run and stretch of the residual."""
    return remainder(*_by_sector(calibration), noise)


def _by_sector(
    calibration: Calibration,
) -> tuple[list[Floats], list[Floats], list[str]]:
    residuals, phases = [], []
    for observation, residual in zip(calibration.observations, calibration.residual_mm, strict=True):
        sector = sector_of(observation.raw, min(SECTORS, len(residual)))
        residuals.append(means(residual, sector))
        # Angles count from +X, so a ball's shift gives the same first harmonic in both directions.
        phases.append(np.radians(observation.raw.circle.theta_deg(means(observation.raw.phi_deg, sector))))
    return residuals, phases, [observation.setup.mounting for observation in calibration.observations]


def is_missing_physics(found: Misfit) -> bool:
    """Return whether the misfit is too improbable to be chance."""
    return found.probability < SIGNIFICANT


@dataclass(frozen=True)
class LeftByFit:
    """The residual beyond noise and mountings, with the probability of an F test of low harmonics."""

    probability: float
    rms_um: float
    missing_physics: bool


def left_by(calibration: Calibration) -> LeftByFit:
    """Return a fit's residual beyond noise and mountings."""
    found = misfit_of(calibration)
    return LeftByFit(found.probability, 1e3 * found.rms, is_missing_physics(found))
