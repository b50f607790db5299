"""Find where a residual differs from noise.

A total sum of squares hides single features. Probabilities are multiplied by the number of trials [Bonferroni; see
`left_over`].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import bands, centred_coefficients
from dbbstation.inference.triangle import root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.harmonics import Spectrum


@dataclass(frozen=True)
class Largest:
    """The most significant of many features.

    Attributes:
        place: harmonic, or run number from 0.
        rms: residual beyond noise, in the channel's unit.
    """

    probability: float
    place: int
    rms: float


@dataclass(frozen=True)
class Remainder:
    """Most significant harmonic, run and pulse of a model's residuals.

    Attributes:
        run: the run with the largest low harmonics.
        pulse: the run with the largest stretch; a turn has `BOUNDS.pulses` stretches.
    """

    harmonic: Largest
    run: Largest
    pulse: Largest
    pulse_phase_rad: float

    @property
    def probability(self) -> float:
        """Return the probability that noise causes any of the three features."""
        return min(1.0, 3.0 * min(one.probability for one in (self.harmonic, self.run, self.pulse)))


def remainder(
    residuals: Sequence[Floats],
    phases_rad: Sequence[Floats],
    groups: Sequence[object],
    noise: Spectrum,
) -> Remainder:
    """Find the most significant harmonic, run and stretch.

    Args:
        groups: each run's group with a common first harmonic.
    """
    low, _ = bands(min(len(residual) for residual in residuals))
    samples = float(np.mean([len(residual) for residual in residuals]))
    power = np.r_[noise.power[: low + 1], noise.power[1 : low + 1]]
    squares = centred_coefficients(residuals, phases_rad, groups, low) ** 2
    order = np.r_[np.arange(low + 1), np.arange(1, low + 1)]
    by_harmonic = [squares[:, order == k] / power[order == k] for k in range(low + 1)]
    in_harmonics = [(float(one.sum()), one.size) for one in by_harmonic]
    in_runs = [(float(one.sum()), one.size) for one in squares / power]
    beyond = [float((squares[:, order == k] - power[order == k]).sum()) for k in range(low + 1)]
    beyond_run = (squares - power).sum(axis=1)
    pulses = [_stretches(r, phase) for r, phase in zip(residuals, phases_rad, strict=True)]
    white = float(noise.power.max())
    in_pulses = [(float(means[at] ** 2 * counts[at] / white), 1) for means, counts, at in pulses]
    run, tried = _largest(in_pulses, noise.freedom)
    means, _, at = pulses[run]
    harmonic, chance = _largest(in_harmonics, noise.freedom)
    worst, by_run = _largest(in_runs, noise.freedom)
    return Remainder(
        Largest(min(1.0, chance * (low + 1)), harmonic, root(beyond[harmonic] / len(residuals) / samples)),
        Largest(min(1.0, by_run * len(residuals)), worst, root(float(beyond_run[worst]) / samples)),
        Largest(min(1.0, tried * BOUNDS.pulses * len(residuals)), run, abs(float(means[at]))),
        (at + 0.5) * 2.0 * np.pi / BOUNDS.pulses,
    )


def _largest(squares: Sequence[tuple[float, int]], freedom: float) -> tuple[int, float]:
    chances = [float(fdtrc(count, freedom, square / count)) for square, count in squares]
    at = int(np.argmin(chances))
    return at, chances[at]


def _stretches(residual: Floats, phase_rad: Floats) -> tuple[Floats, Integers, int]:
    place = np.floor(np.mod(phase_rad, 2.0 * np.pi) / (2.0 * np.pi) * BOUNDS.pulses).astype(np.int64) % BOUNDS.pulses
    counts = np.bincount(place, minlength=BOUNDS.pulses)
    means = np.bincount(place, residual, minlength=BOUNDS.pulses) / np.maximum(counts, 1)
    return means, counts, int(np.argmax(means**2 * counts))
