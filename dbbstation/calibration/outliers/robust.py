"""Detect outlying runs and balls one at a time, and refit without their influence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.calibration.outliers.strange_runs import leave_out, strange_runs
from dbbstation.calibration.outliers.stray_balls import ball_moved, off_its_place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Fit, Outlier, Step
    from dbbstation.model.observation import Observation

MOST = 8
"""Most outliers; more indicate another machine or plan."""


def calibrate_robust(
    fit: Fit,
    observations: Sequence[Observation],
    *,
    balls: bool = True,
) -> tuple[Calibration, tuple[Outlier, ...]]:
    """Fit, and refit after each detected outlier.

    Raises:
        CalibrationError: as raised by `fit`.
    """
    calibration = fit(list(observations))
    runs = list(calibration.observations)
    found: list[Outlier] = []
    while len(found) < MOST:
        step = _next(fit, calibration, runs, balls=balls)
        if step is None:
            break
        outlier, runs, calibration = step
        found.append(outlier)
    return calibration, tuple(found)


def _next(fit: Fit, calibration: Calibration, runs: Sequence[Observation], *, balls: bool) -> Step | None:
    strange = strange_runs(calibration)
    if strange:
        return leave_out(fit, runs, strange)
    if not balls:
        return None
    return ball_moved(fit, calibration, runs) or off_its_place(fit, calibration, runs)
