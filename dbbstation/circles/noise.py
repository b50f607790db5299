"""Noise of a circle, read off its own spectrum where the machine's form has died away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import bands, coefficients, noise_spectrum
from dbbstation.trace.cut import SMALLEST_SHAPE_MM

if TYPE_CHECKING:
    from numpy.typing import NDArray

FEWEST_SAMPLES = 100
"""Samples of a turn below which its spectrum holds no noise apart from its form."""


ROUNDING = float(np.sqrt(12.0))
"""Step of rounded readings over the standard deviation of what rounding does to them [GUM 4.3.7]."""

LEAST_UM = 1e3 * SMALLEST_SHAPE_MM / ROUNDING
"""Noise of a bar as fine as there is none: recordings that were computed have less, and any difference would be found [µm]."""


@dataclass(frozen=True)
class CircleNoise:
    """Noise of one circle.

    Attributes:
        slow_um: standard deviation of white noise, per sample, that would give slow figures the same uncertainty [µm]; NaN where
            there are too few samples.
        resolution_um: step in which the readings come [µm]; zero where none shows.
        freedom: degrees of freedom of `slow_um`.
    """

    slow_um: float
    reading_um: float
    resolution_um: float
    freedom: float
    reading_freedom: float

    @property
    def known(self) -> bool:
        """Whether there were samples enough to separate noise from form."""
        return bool(np.isfinite(self.slow_um))

    @property
    def least_um(self) -> float:
        """Standard deviation that no reading is free of: a coarse one may show no noise at all, its rounding is there [µm]."""
        return max(self.resolution_um / ROUNDING, LEAST_UM)

    @property
    def sigma_um(self) -> float:
        """Standard deviation to count with [µm]."""
        return float(np.hypot(np.nan_to_num(self.slow_um), self.least_um))


def noise_of(
    deviation_um: NDArray[np.float64], phi_deg: NDArray[np.float64], reading_mm: NDArray[np.float64]
) -> CircleNoise:
    """Return the noise of a circle.

    The spectrum above 30 undulations per revolution, a floor and a first-order process, is continued below: readings resemble
    their neighbours, and slow figures then have more noise than single readings would give them (`dbbstation.inference.harmonics`).

    Args:
        deviation_um: radial deviations from the circle in time order, what drifted over the turn taken off, shape (n,) [µm].
        phi_deg: progress along the turn, about equally spaced, shape (n,) [deg].
        reading_mm: the readings that they come from, for the step in which they come, shape (n,) [mm].
    """
    resolution_um = 1e3 * _step_mm(reading_mm)
    if len(deviation_um) < FEWEST_SAMPLES:
        return CircleNoise(float("nan"), float("nan"), resolution_um, 1.0, 1.0)
    low, high = bands(len(deviation_um))
    square = coefficients(deviation_um, np.radians(phi_deg), high)[1:] ** 2
    spectrum = noise_spectrum((square[:high] + square[high:])[low:], low, 2.0)
    lines = np.abs(np.fft.rfft(deviation_um)[low + 1 :]) ** 2 / len(deviation_um)
    # Power of a line is exponentially distributed, with two degrees of freedom and a mean square of twice its mean's square.
    known = 4.0 * float(lines.sum()) ** 2 / max(float(np.sum(lines**2)), np.finfo(float).tiny)
    return CircleNoise(
        slow_um=float(np.sqrt(spectrum.power[0])),
        reading_um=float(np.sqrt(np.mean(lines))),
        resolution_um=resolution_um,
        freedom=spectrum.freedom,
        reading_freedom=max(known, 1.0),
    )


def _step_mm(reading_mm: NDArray[np.float64]) -> float:
    """Step of the readings, where they take few enough values to show one [mm]."""
    values = np.unique(np.round(reading_mm / _FINEST_MM).astype(np.int64))
    if len(values) < 2 or len(values) > len(reading_mm) / _VISITS:  # noqa: PLR2004 - one value has no step
        return 0.0
    return _FINEST_MM * float(np.gcd.reduce(np.diff(values)))


_FINEST_MM = 1e-6
"""Decimals of run files [mm]."""

_VISITS = 3.0
"""Times that each value comes, on average, where readings are coarser than what they show."""
