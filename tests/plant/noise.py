"""Noise of a reading: white, and parts that remember the sample before, each for a time of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray


@dataclass(frozen=True)
class Noise:
    """Standard deviations [µm] of the white and of the correlated part; `correlation` is from sample to sample.

    A second correlated part with another memory makes a colour that no single one has.
    """

    white_um: float = 0.5
    correlated_um: float = 0.0
    correlation: float = 0.6
    second_um: float = 0.0
    second_correlation: float = 0.9

    @property
    def total_um(self) -> float:
        """Standard deviation [µm] of a single reading."""
        return float(np.sqrt(self.white_um**2 + self.correlated_um**2 + self.second_um**2))

    @property
    def slow_um(self) -> float:
        """Standard deviation [µm] of white noise that is as loud at low frequencies: what fits of smooth curves feel."""
        parts = ((self.correlated_um, self.correlation), (self.second_um, self.second_correlation))
        return float(np.sqrt(self.white_um**2 + sum(um**2 * (1.0 + rho) / (1.0 - rho) for um, rho in parts)))

    def drawn_mm(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Noise `(n,)` of a run. Correlated parts are first-order autoregressions, stationary from the start."""
        total_um = self.white_um * rng.standard_normal(count)
        total_um = total_um + _remembering(rng, count, self.correlated_um, self.correlation)
        if self.second_um:
            total_um = total_um + _remembering(rng, count, self.second_um, self.second_correlation)
        return total_um / 1000.0


def _remembering(rng: np.random.Generator, count: int, size_um: float, correlation: float) -> FloatArray:
    pushes_um = size_um * rng.standard_normal(count)
    pushes_um[1:] *= np.sqrt(1.0 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], pushes_um)
