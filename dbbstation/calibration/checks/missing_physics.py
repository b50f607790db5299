"""Test a fit's residual against noise and scatter of mountings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import Misfit, misfit
from dbbstation.inference.remainder import Remainder, remainder
from dbbstation.trace.average import means, sector_of

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.harmonics import Spectrum

SIGNIFICANT = 1e-8
"""Probability below which what is left counts as missing physics. The F test takes the noise from high harmonics; where
neighbouring samples resemble each other it may read a sixth too little, which makes 1e-6 of nothing. The answer hangs little
on it: over the fifteen circles, noise 0.5 µm, gravity that leaves 0.06 µm rms has 1e-3, and one that leaves 0.26 below 1e-99."""

SECTORS = 720
"""Sectors of a turn that residuals are averaged over, at the most: enough for all harmonics that are looked at."""


def misfit_of(calibration: Calibration, noise: Spectrum | None = None) -> Misfit:
    """Return an F test of the residual's low harmonics, without ball positions in each mounting."""
    fitted = int(np.count_nonzero(~calibration.layout.known.random)) - len(calibration.solution.held)
    residuals, phases, mountings = _by_sector(calibration)
    return misfit(residuals, phases, mountings, fitted, noise)


def remainder_of(calibration: Calibration, noise: Spectrum) -> Remainder:
    """Return the most outstanding harmonic, run and stretch of the residual."""
    return remainder(*_by_sector(calibration), noise)


def _by_sector(
    calibration: Calibration,
) -> tuple[list[Floats], list[Floats], list[str]]:
    residuals, phases = [], []
    for observation, residual in zip(calibration.observations, calibration.residual_mm, strict=True):
        sector = sector_of(observation.raw, min(SECTORS, len(residual)))
        residuals.append(means(residual, sector))
        # Angles from +X, so that both directions of a mounting have one first harmonic.
        phases.append(np.radians(observation.raw.circle.theta_deg(means(observation.raw.phi_deg, sector))))
    return residuals, phases, [observation.setup.mounting for observation in calibration.observations]


def is_missing_physics(found: Misfit) -> bool:
    """Return whether chance cannot explain the misfit."""
    return found.probability < SIGNIFICANT


@dataclass(frozen=True)
class LeftByFit:
    """The residual beyond noise and mountings, with its probability by an F test of low harmonics."""

    probability: float
    rms_um: float
    missing_physics: bool


def left_by(calibration: Calibration) -> LeftByFit:
    """Return what a fit leaves beyond noise and mountings."""
    found = misfit_of(calibration)
    return LeftByFit(found.probability, 1e3 * found.rms, is_missing_physics(found))
