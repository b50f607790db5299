"""Noise of a circle, read off its own spectrum where the machine's form has died away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

BAND_UPR = (50, 250)
"""Undulations per revolution between which noise is read: a hexapod's form, screws included, lies below, and what is left
there of reversals is a few of two hundred lines, which a median does not see."""

SAMPLES_PER_UNDULATION = 2.5
"""Samples of the shortest undulation that is looked at: fewer would show others in its place."""

FEWEST_LINES = 8
"""Lines of the spectrum below which its median says nothing."""

_MEDIAN = float(np.log(2.0))
"""Median of a line's power over its mean: power is exponentially distributed."""

_HANN_LINES = 2.0 / 3.0
"""Independent lines per line under a Hann window."""


@dataclass(frozen=True)
class CircleNoise:
    """Noise of one circle.

    Attributes:
        slow_um: standard deviation of white noise that slow figures feel as they feel this one, per sample [µm]; NaN where
            there are too few samples to tell.
        reading_um: standard deviation of single readings [µm].
        resolution_um: step in which the readings come [µm]; zero where none shows.
        freedom: degrees of freedom of `slow_um`.
    """

    slow_um: float
    reading_um: float
    resolution_um: float
    freedom: float

    @property
    def sigma_um(self) -> float:
        """Standard deviation to count with: a coarse reading may show no noise at all, its rounding is there [µm]."""
        return float(np.hypot(np.nan_to_num(self.slow_um), self.resolution_um / np.sqrt(12.0)))


def noise_of(deviation_um: NDArray[np.float64], reading_mm: NDArray[np.float64]) -> CircleNoise:
    """Return the noise of a circle.

    The level of the lines between 50 and 250 undulations per revolution is taken to hold below them too. Noise that remembers
    for longer than a degree or two is louder there and is underestimated.

    Args:
        deviation_um: radial deviations from the circle in time order, about equally spaced, shape (n,) [µm].
        reading_mm: the readings that they come from, for the step in which they come, shape (n,) [mm].
    """
    count = len(deviation_um)
    window = np.hanning(count)
    lines = np.abs(np.fft.rfft(window * (deviation_um - deviation_um.mean()))) ** 2 / np.sum(window**2)
    last = min(BAND_UPR[1], int(count / SAMPLES_PER_UNDULATION))
    band = lines[BAND_UPR[0] : last + 1]
    resolution_um = 1e3 * _step_mm(reading_mm)
    if len(band) < FEWEST_LINES:
        return CircleNoise(float("nan"), float("nan"), resolution_um, 0.0)
    slow = float(np.sqrt(np.median(band) / _MEDIAN))
    reading = float(np.sqrt(np.mean(lines[BAND_UPR[0] :])))
    # A median knows a mean as well as half as many lines: its variance is 1 / (n ln²2) against 1 / n.
    return CircleNoise(slow, reading, resolution_um, 2.0 * len(band) * _HANN_LINES * _MEDIAN**2)


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
