"""Estimate the bar's noise from high harmonics of residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import LOW, smooth

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration


def fine_noise_mm(calibration: Calibration) -> float:
    """Return a reading's noise, estimated above the harmonics of smooth misfit [mm]."""
    square, count = 0.0, 0.0
    for observation, residual in zip(calibration.observations, calibration.residual_mm, strict=True):
        rough = residual - smooth(residual, np.radians(observation.raw.phi_deg))
        square += float(rough @ rough)
        count += max(len(rough) - (2 * LOW + 1), 1)
    return float(np.sqrt(square / count))
