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
        from scipy.linalg import lstsq  # noqa: PLC0415
        from scipy.ndimage import convolve1d  # noqa: PLC0415 - few commands filter

        # The filter of Savitzky and Golay [Anal. Chem. 36 (1964) 1627] as in SciPy's signals, which take half a second to import.
        half, places = window // 2, np.arange(window)
        weights = lstsq((half - places) ** np.arange(CUBIC + 1)[:, None], np.eye(CUBIC + 1)[0])[0]
        smooth = convolve1d(own, weights, mode="constant")
        smooth[:half] = np.polyval(np.polyfit(places, own[:window], CUBIC), places[:half])
        smooth[-half:] = np.polyval(np.polyfit(places, own[-window:], CUBIC), places[-half:])
        reading[motion.kept] = smooth
    return reading
