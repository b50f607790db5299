"""Noise of one turn at low undulations, extrapolated from above by possible memories.

Noise with a memory of more than six degrees has the same slope above 30 undulations. Lines below bound it: noise has at
most their power, and many lines at the expected power are noise. Each line is noise, or form of any size [spike and
slab; Mitchell and Beauchamp, J. Am. Stat. Assoc. 83 (1988) 1023].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import continuations, first_order

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

CORNERS = np.geomspace(1.0, 240.0, 33)
"""Corners of the spectrum that are tried, in undulations, from a memory of a sixth of a turn to none that shows."""

EXPONENTS = np.array([0.5, 0.75, 1.0, 1.25, 1.5])
"""Exponents of power laws that are tried, 1/f noise among them. Drifts have larger ones, do not close, and are a term of their own."""

SLOWEST = 1e-2
"""Cycles per turn down to which power laws go on: a session has about a hundred turns, and the bar is on its calibrator before or after.
The radius under 1/f noise has u by 0.6 of this where they end at a tenth of a cycle, by 1.3 where at a thousandth."""

NOISE_ALONE = 0.5
"""Chance beforehand that a line below 30 undulations is noise alone. A wrong choice is as bad in both directions, hence one half."""

FORM_DECADES = 6.0
"""Decades of power over which form is as likely as not, all alike."""

NOTHING_UM2 = 1e-24
"""Least power of noise: less than the rounding of any length makes, 3e-11 µm at 150 mm. A path that was worked out and not measured
has no more, nor has the difference of two that are the same [µm²]."""

FIRST_FORM = 2
"""The first line that is form. Those before are radius and centre, which were taken off."""


@dataclass(frozen=True, eq=False)
class ContinuedNoise:
    """Noise power at lines 0, 1, ... low, by memory.

    Attributes:
        powers: shape (memories, low + 1) [µm²].
        weights: sum one, shape (memories,).
        freedoms: degrees of freedom of each, shape (memories,).
    """

    powers: Floats
    weights: Floats
    freedoms: Floats

    @property
    def usual(self) -> Floats:
        """Return the geometric mean over memories, shape (low + 1,) [µm²]."""
        return np.asarray(np.exp(self.weights @ np.log(self.powers)))

    @property
    def mean(self) -> Floats:
        """Return the mean over memories, the variance of slow figures, shape (low + 1,) [µm²]."""
        return np.asarray(self.weights @ self.powers)

    def drawn(self, rng: np.random.Generator, draws: int) -> Floats:
        """Return drawn powers, shape (draws, low + 1) [µm²].

        Each draw has one memory and a strength of flat log prior [scaled inverse chi-square; Gelman et al., Bayesian Data
        Analysis, sec. 2.6].
        """
        which = rng.choice(len(self.weights), draws, p=self.weights)
        strength = self.freedoms[which] / rng.chisquare(self.freedoms[which])
        return np.asarray(self.powers[which] * strength[:, None])


def continued_noise(below: Floats, above: Floats, freedom: float = 2.0) -> ContinuedNoise:
    """Extrapolate the noise of one turn.

    Args:
        below: power at lines 0, 1, ... low, with form, shape (low + 1,) [µm²].
        above: noise power above, shape (h,) [µm²].
        freedom: of each line.
    """
    low = len(below) - 1
    found = continuations(freedom * above, low, freedom, _processes)
    if found is None:
        white = np.full((1, low + 1), max(float(above.mean()), NOTHING_UM2))
        return ContinuedNoise(white, np.ones(1), np.array([freedom * len(above)]))
    powers = np.maximum(found.powers, NOTHING_UM2)
    ratio = np.maximum(below[FIRST_FORM:], NOTHING_UM2) / powers[:, FIRST_FORM:]
    alone = NOISE_ALONE * ratio * np.exp(-np.minimum(ratio, 700.0))  # both as densities of the logarithm of the power
    with_form = (1.0 - NOISE_ALONE) * -np.expm1(-ratio) / (FORM_DECADES * np.log(10.0))
    likely = found.likely - _ALIKE + np.log(alone + with_form + np.finfo(float).tiny).sum(axis=1)
    weights = np.exp(likely - likely.max())
    least = 2.0 / (freedom * len(above))
    return ContinuedNoise(powers, weights / weights.sum(), 2.0 / np.clip(found.variances, least, 1.0))


def _processes(harmonic: Floats) -> Floats:
    """Return the power of memories and power laws, shape (corners + exponents, h).

    At lines 0 and 1 a power law is filtered by the window of one turn.
    """
    laws = np.maximum(harmonic, 1.0) ** -EXPONENTS[:, None]
    for line, power in enumerate(_THROUGH_A_TURN):
        laws[:, harmonic == line] = power[:, None]
    return np.vstack([first_order(harmonic, CORNERS), laws])


def _through_a_turn(line: int) -> Floats:
    """Return the power of laws f^-a from `SLOWEST` at a line, shape (exponents,).

    Mean of both rotations, each through sinc², the window of one turn [Priestley, Spectral Analysis and Time Series,
    1981, sec. 6.2].
    """
    cycles = np.concatenate([np.geomspace(SLOWEST, 0.3, 2001)[:-1], np.linspace(0.3, 30.0, 30001)])
    window = np.sinc(cycles - line) ** 2 + np.sinc(cycles + line) ** 2
    return np.asarray(np.trapezoid(cycles ** -EXPONENTS[:, None] * window, cycles, axis=1))


_THROUGH_A_TURN = (_through_a_turn(0), _through_a_turn(1))

_ALIKE = np.log(np.repeat([len(CORNERS), len(EXPONENTS)], [len(CORNERS), len(EXPONENTS)]))
"""Both kinds of noise are as likely beforehand, each shared out evenly."""
