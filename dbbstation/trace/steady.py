"""Mean and standard uncertainty of a constant length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

BATCHES = 10
"""Close readings share vibration and draught; means of ten batches are nearly independent."""


@dataclass(frozen=True)
class Steady:
    """Mean of repeated readings of one length.

    Attributes:
        drift_mm: last batch's mean minus the first's.
    """

    mean_mm: float
    uncertainty_mm: float
    scatter_mm: float
    drift_mm: float
    resolution_mm: float
    count: int


def steady(readings_mm: Floats, resolution_mm: float | None = None) -> Steady:
    """Return mean and standard uncertainty of readings of one length.

    Type A is the standard deviation of the mean of ten batches, because readings are correlated [GUM 4.2.3, 4.2.7]. The
    resolution d adds d / sqrt(12) [GUM F.2.2.1].

    Args:
        resolution_mm: None for the smallest difference of readings.

    Raises:
        ValueError: too few readings, or equal readings without resolution.
    """
    if len(readings_mm) < 2 * BATCHES:
        raise ValueError(f"{len(readings_mm)} readings, at least {2 * BATCHES} are needed")
    if resolution_mm is None:
        steps = np.diff(np.unique(readings_mm))
        if not len(steps):
            raise ValueError("all readings are equal: state the resolution")
        resolution_mm = float(steps.min())
    means = np.array([batch.mean() for batch in np.array_split(readings_mm, BATCHES)])
    of_mean = float(means.std(ddof=1)) / np.sqrt(BATCHES)
    return Steady(
        mean_mm=float(readings_mm.mean()),
        uncertainty_mm=float(np.hypot(of_mean, resolution_mm / np.sqrt(12.0))),
        scatter_mm=float(readings_mm.std(ddof=1)),
        drift_mm=float(means[-1] - means[0]),
        resolution_mm=resolution_mm,
        count=len(readings_mm),
    )
