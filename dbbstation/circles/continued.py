"""Extrapolate one turn's noise to low undulations, for possible correlation lengths.

All noise correlated over more than six degrees has the same slope above 30 undulations. Lower lines bound its power:
noise cannot exceed them, and many lines at the expected power are noise. Each line is noise alone, or noise with form
of any size [spike and slab; Mitchell and Beauchamp, J. Am. Stat. Assoc. 83 (1988) 1023].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.harmonics import continuations, first_order

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

CORNERS = np.geomspace(1.0, 240.0, 33)
"""Tried corner frequencies in undulations: correlation over a sixth of a turn to no visible correlation."""

EXPONENTS = np.array([0.5, 0.75, 1.0, 1.25, 1.5])
"""Tried exponents of power laws, including 1/f noise. Drifts have larger exponents, do not close, and are a separate term."""

SLOWEST = 1e-2
"""Lowest frequency of power laws in cycles per turn: a session has about a hundred turns, and the calibrator bounds
slower changes. For 1/f noise, u of the radius is 0.6 times as large with a tenth of a cycle, 1.3 times with a
thousandth."""

NOISE_ALONE = 0.5
"""Prior probability that a line below 30 undulations is noise alone. Both errors are equally bad, hence one half."""

FORM_DECADES = 6.0
"""Decades of the uniform prior of a form's log power."""

OF_A_LINE = 2.0
"""Degrees of freedom of a line: cosine and sine."""

NOTHING_UM2 = 1e-24
"""Least noise power [µm²], below the rounding of any length, 3e-11 µm at 150 mm. Computed paths and differences of
equal paths have less."""

FIRST_FORM = 2
"""First line of form; the lines before, radius and centre, are removed."""


@dataclass(frozen=True, eq=False)
class ContinuedNoise:
    """Noise power at lines 0, 1, ... low, for each noise model.

    Attributes:
        powers: shape (models, low + 1) [µm²].
        weights: posterior probabilities, shape (models,).
        freedoms: degrees of freedom, shape (models,).
    """

    powers: Floats
    weights: Floats
    freedoms: Floats

    @property
    def usual(self) -> Floats:
        """Return the geometric mean over models, shape (low + 1,) [µm²]."""
        return np.asarray(np.exp(self.weights @ np.log(self.powers)))

    @property
    def mean(self) -> Floats:
        """Return the mean over models, the variance of slow figures, shape (low + 1,) [µm²]."""
        return np.asarray(self.weights @ self.powers)

    def drawn(self, rng: np.random.Generator, draws: int) -> Floats:
        """Return drawn powers, shape (draws, low + 1) [µm²]."""
        # Each draw has one model, and a strength with a flat log prior [scaled inverse chi-square; Gelman et al.,
        # Bayesian Data Analysis, sec. 2.6].
        which = rng.choice(len(self.weights), draws, p=self.weights)
        strength = self.freedoms[which] / rng.chisquare(self.freedoms[which])
        return np.asarray(self.powers[which] * strength[:, None])


def continued_noise(below: Floats, above: Floats) -> ContinuedNoise:
    """Extrapolate one turn's noise to lines 0, 1, ... low.

    Args:
        below: power at these lines, form included, shape (low + 1,) [µm²].
        above: noise power at the lines above, shape (h,) [µm²].
    """
    low = len(below) - 1
    found = continuations(OF_A_LINE * above, low, OF_A_LINE, _processes)
    if found is None:
        white = np.full((1, low + 1), max(float(above.mean()), NOTHING_UM2))
        return ContinuedNoise(white, np.ones(1), np.array([OF_A_LINE * len(above)]))
    powers = np.maximum(found.powers, NOTHING_UM2)
    ratio = np.maximum(below[FIRST_FORM:], NOTHING_UM2) / powers[:, FIRST_FORM:]
    alone = NOISE_ALONE * ratio * np.exp(-np.minimum(ratio, 700.0))  # both are densities of the logarithm of the power
    with_form = (1.0 - NOISE_ALONE) * -np.expm1(-ratio) / (FORM_DECADES * np.log(10.0))
    likely = found.likely - _ALIKE + np.log(alone + with_form + np.finfo(float).tiny).sum(axis=1)
    weights = np.exp(likely - likely.max())
    least = 2.0 / (OF_A_LINE * len(above))
    return ContinuedNoise(powers, weights / weights.sum(), 2.0 / np.clip(found.variances, least, 1.0))


def _processes(harmonic: Floats) -> Floats:
    """Return the power of first-order processes and power laws, shape (corners + exponents, h)."""
    # At lines 0 and 1 a power law is filtered by the window of one turn.
    laws = np.maximum(harmonic, 1.0) ** -EXPONENTS[:, None]
    for line, power in enumerate(_THROUGH_A_TURN):
        laws[:, harmonic == line] = power[:, None]
    return np.vstack([first_order(harmonic, CORNERS), laws])


def _through_a_turn(line: int) -> Floats:
    """Return the power of laws f^-a at one line, cut off below `SLOWEST`, shape (exponents,)."""
    # The result is the mean over positive and negative frequencies, each filtered by sinc², the window of one turn
    # [Priestley, Spectral Analysis and Time Series, 1981, sec. 6.2].
    cycles = np.concatenate([np.geomspace(SLOWEST, 0.3, 2001)[:-1], np.linspace(0.3, 30.0, 30001)])
    window = np.sinc(cycles - line) ** 2 + np.sinc(cycles + line) ** 2
    return np.asarray(np.trapezoid(cycles ** -EXPONENTS[:, None] * window, cycles, axis=1))


_THROUGH_A_TURN = (_through_a_turn(0), _through_a_turn(1))

_ALIKE = np.log(np.repeat([len(CORNERS), len(EXPONENTS)], [len(CORNERS), len(EXPONENTS)]))
"""Log prior: both kinds of noise are equally probable, and so are the models within a kind."""
