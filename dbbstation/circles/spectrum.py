"""A circle's undulations, compared with noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.quantity import FIRST
from dbbstation.inference.harmonics import SAMPLES_PER_HARMONIC, coefficients

if TYPE_CHECKING:
    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats, Integers

HIGHEST = 60
"""Highest undulations per revolution with an amplitude, twice as many as usual in a machine's form."""


@dataclass(frozen=True, eq=False)
class FormSpectrum:
    """Unfiltered amplitudes about the least-squares circle.

    Attributes:
        amplitude_um: half of peak to valley, shape (h,).
        noise_um: rms amplitude of noise; NaN if unknown.
    """

    undulations: Integers
    amplitude_um: Floats
    noise_um: float


def spectrum_of(one: CircleAnalysis) -> FormSpectrum:
    """Return a circle's undulations.

    White noise s per sample has the rms amplitude 2 s / sqrt(n), from two coefficients.
    """
    count = len(one.raw)
    highest = min(HIGHEST, count // SAMPLES_PER_HARMONIC)
    if highest < FIRST:
        return FormSpectrum(np.arange(0), np.zeros(0), float("nan"))
    found = coefficients(one.residual_um, np.radians(one.raw.theta_deg), highest)
    amplitude = np.sqrt(2.0 / count) * np.hypot(found[1 : highest + 1], found[highest + 1 :])
    noise_um = 2.0 * one.noise.slow_um / float(np.sqrt(count))
    return FormSpectrum(np.arange(FIRST, highest + 1), amplitude[FIRST - 1 :], noise_um)
