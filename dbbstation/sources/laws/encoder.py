"""Noise-free place of the bar's encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.sources.contract import Motion

WINDOWS = 40
"""Pieces of a run on which readings are fitted by a cubic: nine degrees of a circle."""

CUBIC = 3


def reading_without_noise_mm(motion: Motion) -> Floats:
    """Return the reading without most of its noise, shape (n,) [mm].

    An error evaluated at noisy readings would itself look like noise and be misidentified.
    """
    return motion.once("reading without noise", None, lambda: _smoothed(motion))


def _smoothed(motion: Motion) -> Floats:
    reading = np.array(motion.reading_mm, dtype=np.float64)
    own = reading[motion.kept]
    window = 2 * (len(own) // (2 * WINDOWS)) + 1
    if motion.reading_is_measured and window > CUBIC:
        from scipy.signal import savgol_filter  # noqa: PLC0415 - takes half a second; every command knows all sources

        reading[motion.kept] = savgol_filter(own, window, CUBIC)
    return reading
