"""Estimate a circle's noise from its spectrum above the machine's form."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of, sum_of
from dbbstation.inference.harmonics import bands, coefficients, noise_spectrum
from dbbstation.trace.cut import FINEST_STEP_MM

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

FEWEST_SAMPLES = 100
"""Fewest samples of a turn whose spectrum separates noise from form."""


ROUNDING = sqrt(12.0)
"""Step of rounded readings over the standard deviation of rounding [GUM 4.3.7]."""

LEAST_UM = 1e3 * FINEST_STEP_MM / ROUNDING
"""Least noise, below any real bar [µm]. Computed recordings have less, and any difference would be significant."""


@dataclass(frozen=True)
class CircleNoise:
    """Noise of one circle.

    Attributes:
        slow_um: white noise per sample with the actual noise's effect on slow figures; NaN for too few samples.
        resolution_um: reading step; zero if undetectable.
        freedom: degrees of freedom of `slow_um`.
    """

    slow_um: float
    reading_um: float
    resolution_um: float
    freedom: float
    reading_freedom: float

    @property
    def known(self) -> bool:
        """Return whether noise and form are separable."""
        return bool(np.isfinite(self.slow_um))

    @property
    def least_um(self) -> float:
        """Return the least noise of a reading, due to rounding [µm]."""
        return max(self.resolution_um / ROUNDING, LEAST_UM)

    @property
    def sigma_um(self) -> float:
        """Return the noise's standard deviation for tests [µm]."""
        return hypot_of(np.nan_to_num(self.slow_um), self.least_um)


def noise_of(deviation_um: Floats, phi_deg: Floats, reading_mm: Floats) -> CircleNoise:
    """Return a circle's noise.

    Args:
        deviation_um: in time order, without drift, shape (n,).
        phi_deg: about equally spaced, shape (n,).
        reading_mm: for the reading step, shape (n,).
    """
    # A floor and a first-order process are fitted above 30 undulations per revolution and extrapolated below
    # (`dbbstation.inference.harmonics`), because correlation makes slow figures noisier.
    resolution_um = 1e3 * _step_mm(reading_mm)
    if len(deviation_um) < FEWEST_SAMPLES:
        return CircleNoise(float("nan"), float("nan"), resolution_um, 1.0, 1.0)
    low, high = bands(len(deviation_um))
    square = coefficients(deviation_um, np.radians(phi_deg), high)[1:] ** 2
    spectrum = noise_spectrum((square[:high] + square[high:])[low:], low, 2.0)
    lines = np.abs(np.fft.rfft(deviation_um)[low + 1 :]) ** 2 / len(deviation_um)
    # A line's power is exponentially distributed: two degrees of freedom, mean square twice the squared mean.
    known = 4.0 * float(lines.sum()) ** 2 / max(sum_of(lines**2), np.finfo(float).tiny)
    return CircleNoise(
        slow_um=sqrt(spectrum.power[0]),
        reading_um=sqrt(np.mean(lines)),
        resolution_um=resolution_um,
        freedom=spectrum.freedom,
        reading_freedom=max(known, 1.0),
    )


def _step_mm(reading_mm: Floats) -> float:
    values = np.unique(np.round(reading_mm / _FINEST_MM).astype(np.int64))
    if len(values) < 2 or len(values) > len(reading_mm) / _VISITS:  # noqa: PLR2004 - one value gives no step
        return 0.0
    return _FINEST_MM * float(np.gcd.reduce(np.diff(values)))


_FINEST_MM = 1e-6
"""Resolution of run files [mm]."""

_VISITS = 3.0
"""Average repetitions of a value when the reading step exceeds the noise."""
