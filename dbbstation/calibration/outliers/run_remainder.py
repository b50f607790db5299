"""Residuals of runs, and their part that no ball shift explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation


def left_of(calibration: Calibration) -> list[tuple[Observation, Floats]]:
    """Yield every run with its residual, shape (n,) [mm]."""
    return list(zip(calibration.observations, calibration.residual_mm, strict=True))


def shift_of(observation: Observation, residual: Floats) -> Floats:
    """Return the ball's shift that best explains a residual, in X and Y, shape (2,) [mm]."""
    return -np.asarray(np.linalg.lstsq(_harmonics(observation), residual, rcond=None)[0][:2], dtype=np.float64)


def without_shift(observation: Observation, residual: Floats) -> Floats:
    """Return a residual, shape (n,) [mm], less its best in-plane shift."""
    columns = _harmonics(observation)[:, :2]
    return residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]


def rms_um(residual: Floats) -> float:
    """Return the root mean square [µm] of a residual [mm]."""
    return 1e3 * float(np.sqrt(np.mean(residual**2)))


def _harmonics(observation: Observation) -> Floats:
    theta = np.radians(observation.raw.theta_deg)
    flat = np.cos(np.radians(observation.raw.circle.elevation_deg))
    return np.column_stack([flat * np.cos(theta), flat * np.sin(theta), np.ones(len(theta))])
