"""What two sessions may differ by without a change: noise, balls put up anew, bars and angles known so well."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from dbbstation.inference.harmonics import bands, coefficients, noise_spectrum
from dbbstation.plan.circle import FULL_TURN_DEG

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare_pairs import Pair

RESOLUTION_MM = 1e-5
"""Noise that every difference has at the least, per common angle: no bar shows less, and simulations have none [mm]."""

ANYWHERE_MM = 1.0
"""Scatter of a ball whose place nobody knows [mm]."""

LOWEST = 3
"""Highest harmonic into which what is stated of a session reaches."""

ANGLE_SHARE = 0.1
"""Share of the spacing of its samples by which a run may be off in its angle, one standard deviation: feed-in and
feed-out, which tell where the turn began, are over in less than a sample of a slow recording. A circle that is 0.2 mm
off its centre changes by 0.2 µm in a twentieth of a degree."""


@dataclass(frozen=True, eq=False)
class Chance:
    """Low harmonics of the differences of r runs, and what chance puts there.

    Coefficients are ordered constant, cosines 1 to l, sines 1 to l; k = 2 l + 1.

    Attributes:
        low: highest harmonic l that counts as smooth.
        coefficients: orthonormal, of B less A, shape (r, k) [mm].
        noise: variance of each coefficient by the noise of the readings, shape (r, k) [mm²].
        run_freedom: degrees of freedom with which the noise of one run is known.
        freedom: with which the noise of all runs together is known.
        stated: how the lowest harmonics of each run, those of `lowest_columns`, answer to q standard deviations of what
            is stated of mountings, CMM sheets, bars and angles, shape (r, m, q) [mm].
    """

    low: int
    coefficients: NDArray[np.float64]
    noise: NDArray[np.float64]
    run_freedom: float
    freedom: float
    stated: NDArray[np.float64]

    @property
    def harmonic(self) -> NDArray[np.int64]:
        """Harmonic of each coefficient, shape (k,)."""
        return np.concatenate([[0], np.arange(1, self.low + 1), np.arange(1, self.low + 1)])

    @property
    def stated_variance(self) -> NDArray[np.float64]:
        """Variance of each coefficient by what is stated, shape (r, k) [mm²]."""
        return stated_variance(self.low, self.noise, self.stated)


def chance_of(pairs: Sequence[Pair]) -> Chance:
    """Read the noise of every difference from its high harmonics, and what is stated from both sessions.

    Level by run, shape of the spectrum from all runs together.
    """
    differences = [pair.difference_mm for pair in pairs]
    phases = [np.radians(pair.theta_deg) for pair in pairs]
    low, high = bands(len(differences[0]))
    all_of_them = np.array([coefficients(d, phase, high) for d, phase in zip(differences, phases, strict=True)])
    squares = all_of_them[:, 1 : high + 1] ** 2 + all_of_them[:, high + 1 :] ** 2
    level = np.maximum(squares[:, low:].mean(axis=1) / 2.0, RESOLUTION_MM**2)
    spectrum = noise_spectrum((squares[:, low:] / level[:, None]).sum(axis=0), low, 2.0 * len(pairs))
    chosen = np.concatenate([[0], np.arange(1, low + 1), np.arange(high + 1, high + low + 1)])
    harmonic = np.concatenate([[0], np.arange(1, low + 1), np.arange(1, low + 1)])
    own = 2.0 * (high - low)
    return Chance(
        low=low,
        coefficients=all_of_them[:, chosen],
        noise=np.maximum(level[:, None] * spectrum.power[harmonic], RESOLUTION_MM**2),
        run_freedom=1.0 / (1.0 / own + 1.0 / spectrum.freedom),
        freedom=spectrum.freedom,
        stated=_stated(pairs, low),
    )


def first_columns(low: int) -> list[int]:
    """Places of constant, first cosine and first sine."""
    return [0, 1, low + 1]


def lowest_columns(low: int) -> list[int]:
    """Places of the harmonics up to the third: balls, bars and angles reach no others by more than noise."""
    highest = min(LOWEST, low)
    return [0, *range(1, highest + 1), *range(low + 1, low + highest + 1)]


def stated_variance(low: int, like: NDArray[np.float64], stated: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of every coefficient by what is stated, in the shape (r, k) of `like` [mm²]."""
    variance = np.zeros_like(like)
    variance[:, lowest_columns(low)] = np.sum(stated**2, axis=2)
    return variance


def of_ball(pair: Pair) -> NDArray[np.float64]:
    """Constant, first cosine and first sine of the reading for a shift of the ball by 1 mm in x, y, z, shape (3, 3)."""
    count, elevation = len(pair.a_mm), np.radians(pair.circle.elevation_deg)
    found = np.zeros((3, 3))
    found[1, 0] = found[2, 1] = -np.cos(elevation) * np.sqrt(count / 2.0)
    found[0, 2] = -np.sin(elevation) * np.sqrt(count)
    return found


def _stated(pairs: Sequence[Pair], low: int) -> NDArray[np.float64]:
    """One column per coordinate of every mounting and ball of each session, one per bar, one per angle of a run."""
    numbers: dict[tuple[str, str, str], int] = {}
    entries: list[tuple[int, NDArray[np.float64], tuple[str, str, str]]] = []
    lowest = lowest_columns(low)
    first = [lowest.index(column) for column in first_columns(low)]
    for r, pair in enumerate(pairs):
        ball, constant = np.zeros((len(lowest), 3)), np.zeros((len(lowest), 1))
        ball[first] = of_ball(pair)
        constant[0] = np.sqrt(len(pair.a_mm))
        by_angle = _by_angle(pair, low)[lowest, None]
        for session, runs in (("A", pair.a), ("B", pair.b)):
            share = 1.0 / len(runs) if session == "B" else -1.0 / len(runs)
            for n, run in enumerate(runs):
                setup = run.setup
                again = setup.mounting_repeatability_mm if setup.place_known else ANYWHERE_MM
                turned_rad = ANGLE_SHARE * 2.0 * np.pi / len(run.raw)
                effects = (
                    ("mounting", setup.mounting, ball * again),
                    ("ball", setup.ball, ball * setup.ball_uncertainty_mm),
                    ("bar", setup.instrument, constant * setup.bar_uncertainty_mm),
                    ("angle", f"{pair.label} {n}", by_angle * turned_rad),
                )
                for kind, name, effect in effects:
                    key = (session, kind, name)
                    numbers.setdefault(key, sum(_WIDTH[kind] for _, kind, _ in numbers))
                    entries.append((r, share * effect, key))
    stated = np.zeros((len(pairs), len(lowest), sum(_WIDTH[kind] for _, kind, _ in numbers)))
    for r, effect, key in entries:
        stated[r, :, numbers[key] : numbers[key] + effect.shape[1]] += effect
    return stated


def _by_angle(pair: Pair, low: int) -> NDArray[np.float64]:
    """Coefficients of the slope of the reading along the angle, of A as of B, shape (2 low + 1,) [mm/rad]."""
    there = np.isfinite(pair.a_mm)
    readings = np.interp(pair.theta_deg, pair.theta_deg[there], pair.a_mm[there], period=FULL_TURN_DEG)
    found = coefficients(readings, np.radians(pair.theta_deg), low)
    order = np.arange(1, low + 1)
    return np.concatenate([[0.0], order * found[low + 1 :], -order * found[1 : low + 1]])


_WIDTH = {"mounting": 3, "ball": 3, "bar": 1, "angle": 1}


@dataclass(frozen=True, eq=False)
class Weighting:
    """Makes coefficients independent and of unit variance.

    Attributes:
        low: highest smooth harmonic.
        deviation: standard deviation of each coefficient by itself, shape (r, k).
        root: Cholesky factor of the covariance of the lowest harmonics of all runs, shape (m r, m r).
    """

    low: int
    deviation: NDArray[np.float64]
    root: NDArray[np.float64]

    @classmethod
    def of(cls, low: int, variance: NDArray[np.float64], stated: NDArray[np.float64]) -> Weighting:
        """Weighting for variances, shape (r, k), beside what is stated, shape (r, m, q)."""
        wide = stated.reshape(-1, stated.shape[2])
        lowest = variance[:, lowest_columns(low)].ravel()
        root = np.linalg.cholesky(wide @ wide.T + np.diag(lowest))
        return cls(low, np.sqrt(variance), np.asarray(root, dtype=np.float64))

    @cached_property
    def precision(self) -> NDArray[np.float64]:
        """Diagonal of the inverse covariance, shape (r, k)."""
        found = 1.0 / self.deviation**2
        inverse = solve_triangular(self.root, np.eye(len(self.root)), lower=True)
        found[:, lowest_columns(self.low)] = np.sum(inverse**2, axis=0).reshape(len(found), -1)
        return found

    def whitened(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of shape (r, k, p) as rows of shape (r k, p)."""
        found = values / self.deviation[:, :, None]
        lowest = lowest_columns(self.low)
        block = values[:, lowest].reshape(-1, values.shape[2])
        white = solve_triangular(self.root, block, lower=True)
        found[:, lowest] = white.reshape(len(values), len(lowest), -1)
        return found.reshape(-1, values.shape[2])

    def beyond(self, values: NDArray[np.float64]) -> float:
        """Sum of squares of values, shape (r, k), beyond noise and what is stated; not negative.

        Two bounds from below, of which the greater counts. What the best guess of balls, bars and angles leaves, less
        noise: with V the whole covariance and D that of the noise, this is D V^-1 values; the guess takes even a ball
        that moved by a hundred times what is stated. And everything less what noise and balls put there on average,
        which is nothing where they happened to sit better.
        """
        left = values / self.deviation**2
        lowest = lowest_columns(self.low)
        block = values[:, lowest].ravel()
        white = solve_triangular(self.root, block, lower=True)
        left[:, lowest] = solve_triangular(self.root, white, lower=True, trans="T").reshape(len(values), -1)
        variance = self.deviation**2
        unguessed = float(np.sum((variance * left) ** 2) - np.sum(variance**2 * self.precision))
        usual = variance.copy()
        usual[:, lowest] = np.sum(self.root**2, axis=1).reshape(len(values), -1)
        return max(unguessed, float(np.sum(values**2) - np.sum(usual)), 0.0)
