"""Sums over bins of a variable, from which curves' explained squares are computed quickly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import rfft

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.forms import Bump, Form, StepForm, Wave

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over one variable's bins for d directions.

    A gain is the effect of one prior standard deviation, over noise.

    Attributes:
        at: mean values of bins, shape (b,) or (b, c).
        place: numbers of bins from zero, shape (b,).
        rest: sums of gain times residual, shape (b, d).
        gains: sums of gain times gain, shape (b, d, d).
        base: sums of gain times base directions, shape (b, d, k).
    """

    at: Floats
    place: Integers
    rest: Floats
    gains: Floats
    base: Floats

    @cached_property
    def scaled(self) -> tuple[Floats, float, float]:
        """Return bins from -1 to 1, shape (b,), and their middle and half range."""
        low, high = float(self.at.min()), float(self.at.max())
        half = max((high - low) / 2.0, np.finfo(np.float64).tiny)
        return (self.at - (low + high) / 2.0) / half, (low + high) / 2.0, half

    @cached_property
    def cardinal(self) -> Floats:
        """Return the polynomials that are one at one of `NODES` and zero at the others, shape (24, b)."""
        at_nodes, at_bins = (np.polynomial.chebyshev.chebvander(x, len(NODES) - 1) for x in (NODES, self.scaled[0]))
        at_nodes[:, 1:] *= 2.0
        return at_nodes @ at_bins.T / len(NODES)

    def explained(self, curves: Floats) -> Floats:
        """Return the squares, shape (m,), that curves, shape (b, m, p), explain given the base."""
        pieces, many, count = curves.shape
        flat = curves.reshape(pieces, many * count).T
        rest = (flat @ self.rest).reshape(many, count, -1)
        base = (flat @ self.base.reshape(pieces, -1)).reshape(many, count, *self.base.shape[1:])
        pairs = (curves[:, :, :, None] * curves[:, :, None, :]).reshape(pieces, -1)
        gains = (pairs.T @ self.gains.reshape(pieces, -1)).reshape(many, count, count, *self.gains.shape[1:])
        return solved(rest, taken(base), gains)

    def of_forms(self, forms: Sequence[Form]) -> Floats:
        """Return squares explained by forms, shape (m,)."""
        curves = [form.columns(self.at) for form in forms]
        return self.explained(np.stack(curves, axis=1)) if curves else np.zeros(0)

    def of_waves(self, length: int, first: int, last: int) -> Floats:
        """Return squares explained by waves of `first` to `last` - 1 periods in `length` bins, by Fourier transform."""
        pieces, directions, width = self.base.shape

        def transformed(values: Floats, step: int) -> NDArray[np.complex128]:
            wide = np.zeros((length, values.shape[1]))
            wide[self.place] = values
            return rfft(wide, axis=0)[step * first : step * last : step]

        of_base = np.zeros((last - first, 2 * directions, 2 * directions))
        for column in range(0, width, BOUNDS.sums_at_once):
            some = self.base[:, :, column : column + BOUNDS.sums_at_once].reshape(pieces, -1)
            of_base += taken(sides(transformed(some, 1).reshape(last - first, directions, -1)))
        twice = transformed(self.gains.reshape(pieces, -1), 2).reshape(last - first, directions, directions)
        return solved(sides(transformed(self.rest, 1)), of_base, squares(self.gains.sum(axis=0), twice))

    def best(self, forms: Sequence[Form], most: int) -> list[tuple[float, Form]]:
        """Return the locally best forms of a list with explained squares, best first."""
        explained = self.of_forms(forms)
        return [(float(explained[k]), forms[k]) for k in peaks(explained, most)]

    def finer(self, frequencies: Iterable[float], extent: float) -> list[tuple[float, Wave]]:
        """Optimise waves near given frequencies; return waves with explained squares, best first.

        Args:
            extent: of the variable.
        """
        found = []
        for frequency in frequencies:
            waves, best = NearbyWaves(self, frequency), frequency
            for step in FINER:
                near = np.asarray(best + np.arange(-15, 16) * step / extent, dtype=np.float64)
                near = near[near > 0.25 / extent]
                explained = waves.explained(near)
                best = float(near[int(explained.argmax())])
            found.append((float(explained.max()), Wave(best)))
        return sorted(found, key=lambda one: -one[0])


FINER = (1.0 / 30.0, 1.0 / 450.0)
"""Successive frequency steps, in units of one over the extent; the last gives the phase within a degree over the
extent."""


def peaks(explained: Floats, most: int) -> Integers:
    """Return local maxima, best first."""
    padded = np.concatenate([[-np.inf], explained, [-np.inf]])
    found = np.flatnonzero((explained >= padded[:-2]) & (explained >= padded[2:]))
    return found[np.argsort(-explained[found])][:most]


def bumps(low: float, high: float, widths: Iterable[float]) -> list[Form]:
    """Return bumps of given widths, not at the ends."""
    return [Bump(float(at), width) for width in widths for at in np.arange(low + width, high - width, width / 2.0)]


def steps(low: float, high: float, count: int) -> list[Form]:
    """Return sharp steps, not at the ends."""
    wide = (high - low) / count
    return [StepForm(float(at), wide / 4.0) for at in np.linspace(low, high, count + 1)[2:-2]] if wide > 0.0 else []


class NearbyWaves:
    """Squares explained by waves near a frequency, from sums at Chebyshev points.

    For x in -1..1, exp(i a x) is interpolated between its values at `NODES` Chebyshev points, whose error is twice the
    sum of the |J_n(a)| beyond [Trefethen, Approximation Theory and Approximation Practice, 2013, ch. 4].
    """

    def __init__(self, sums: Sums, frequency: float) -> None:
        self._frequency, self._directions = frequency, sums.rest.shape[1]
        self._mean = sums.gains.sum(axis=0)
        x, middle, self._half = sums.scaled
        wave, pieces = np.exp(2j * np.pi * frequency * (sums.at - middle))[:, None], len(x)
        self._rest, self._base, self._twice = (
            sums.cardinal @ (wave**power * values.reshape(pieces, -1))
            for values, power in ((sums.rest, 1), (sums.base, 1), (sums.gains, 2))
        )

    def explained(self, frequencies: Floats) -> Floats:
        """Return squares explained by waves of given frequencies, shape (m,)."""
        many, d = len(frequencies), self._directions
        turned = np.exp(2j * np.pi * self._half * np.outer(frequencies - self._frequency, NODES))
        rest = sides((turned @ self._rest).conj())
        base = sides((turned @ self._base).conj()).reshape(many, 2, d, -1)
        return solved(rest, taken(base), squares(self._mean, (turned**2 @ self._twice).conj().reshape(many, d, d)))


REACH = 0.55
"""Largest distance from the central frequency, in waves over the extent."""

NODES = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
"""Chebyshev points, shape (24,): J_24(2 pi REACH) is below 2e-17."""


def sides(transform: NDArray[np.complex128]) -> Floats:
    """Return cosine and sine sums, shape (m, 2, ...), from sums with exp(-ix), shape (m, ...)."""
    return np.stack([transform.real, -transform.imag], axis=1)


def squares(mean: Floats, twice: NDArray[np.complex128]) -> Floats:
    """Return sums of cosine and sine products, shape (m, 2, 2, d, d), from sums with 1, (d, d), and exp(-2ix), (m, d, d)."""
    # cos² = (1 + cos 2x) / 2, sin² = (1 - cos 2x) / 2, sin cos = sin 2x / 2
    found = np.empty((len(twice), 2, 2, *mean.shape))
    found[:, 0, 0], found[:, 1, 1] = (mean + twice.real) / 2.0, (mean - twice.real) / 2.0
    found[:, 0, 1] = found[:, 1, 0] = -twice.imag / 2.0
    return found


def taken(base: Floats) -> Floats:
    """Return the base's part of curve products, (m, p d, p d), from sums of shape (m, p, d, k)."""
    side = base.reshape(len(base), base.shape[1] * base.shape[2], -1)
    return side @ side.transpose(0, 2, 1)


def solved(rest: Floats, of_base: Floats, gains: Floats) -> Floats:
    """Return squares explained by columns, from residual sums (m, p, d), `taken` and products (m, p, p, d, d)."""
    many, size = len(rest), rest.shape[1] * rest.shape[2]
    normal = gains.transpose(0, 1, 3, 2, 4).reshape(many, size, size) - of_base + np.eye(size)
    right = rest.reshape(many, size, 1)
    return (right * np.linalg.solve(normal, right)).sum(axis=(1, 2))
