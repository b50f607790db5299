"""Test whether noise and scatter of mountings explain a fit's residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import Misfit, misfit
from dbbstation.inference.remainder import Remainder, remainder
from dbbstation.trace.recording import means, sector_of

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.harmonics import Spectrum

SIGNIFICANT = 1e-8
"""Probability below which a residual counts as missing physics. The F test estimates noise at high harmonics.
Correlated samples may lower this estimate by a sixth, which alone gives 1e-6. The limit hardly matters: on the fifteen
circles with noise of 0.5 µm, a gravity residual of 0.06 µm rms gives 1e-3, and 0.26 µm gives less than 1e-99."""

SECTORS = 720
"""Most sectors per turn for averaging residuals, enough for all tested harmonics."""


def misfit_of(calibration: Calibration, noise: Spectrum | None = None) -> Misfit:
    """Return an F test of the residual's low harmonics, after removal of a ball position per mounting."""
    fitted = int(np.count_nonzero(~calibration.layout.known.random)) - len(calibration.solution.held)
    residuals, phases, mountings = _by_sector(calibration)
    return misfit(residuals, phases, mountings, fitted, noise)


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
