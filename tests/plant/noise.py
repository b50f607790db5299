"""Noise of a reading: white, and a part that remembers the sample before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray


@dataclass(frozen=True)
class Noise:
    """Standard deviations [µm] of the white and of the correlated part; `correlation` is from sample to sample."""

    white_um: float = 0.5
    correlated_um: float = 0.0
    correlation: float = 0.6

    def drawn_mm(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Noise `(n,)` of a run. The correlated part is a first-order autoregression, stationary from the start."""
        white_um = self.white_um * rng.standard_normal(count)
        pushes_um = self.correlated_um * rng.standard_normal(count)
        pushes_um[1:] *= np.sqrt(1.0 - self.correlation**2)
        return (white_um + lfilter([1.0], [1.0, -self.correlation], pushes_um)) / 1000.0
