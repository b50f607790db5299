"""Estimate ranges of noisy paths without the contribution of noise.

Noise widens a range by an amount that depends on the form. Simulated paths combine this form, scaled, with noise of the
measured spectrum (parametric bootstrap [Efron and Tibshirani, An Introduction to the Bootstrap, ch. 12 to 14]). The
estimate is the size whose mean range equals the measured range. Sizes whose 2.5th or 97.5th percentile equals it bound
the interval [confidence interval by inversion of a test, Casella and Berger, Statistical Inference, 9.2.1]. The
interval starts at zero if noise alone suffices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import chndtr, chndtrinc

from dbbstation.circles.form import drawn_lines
from dbbstation.computing.arrays import average_of, sum_of
from dbbstation.computing.compiled import compiled
from dbbstation.facts.quantities import FULL_TURN_DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.circles.form import FormAndNoise
    from dbbstation.computing.arrays import Floats, Integers

    Statistic = Callable[[Floats, Floats, Floats], Floats]

DRAWS = 256
"""Number of drawn paths, which determine their standard deviation to 4.5 %."""

SECTORS = 360
"""Most sectors whose extreme samples are kept of each drawn path: form hardly changes within a degree."""

POINTS_PER_UNDULATION = 8
"""Samples kept per undulation that a filter passes: the path is smooth between them."""

LONG_TURN = 1000
"""Samples of a turn above which the length of draws matters: draws of 1,009 take twice the time of 1,024."""

QUANTILE = 1.96
"""Standard deviations at the ends of a 95 % interval [normal distribution]."""

STEPS = np.array([-np.inf, -14.0, -9.0, -6.0, -4.0, -2.5, -1.0, 0.5, 2.0, 3.5])
"""Tried sizes: the measured range plus so many standard deviations of a sample's noise; -inf means zero. In a range of
many thousand samples normal noise adds less than nine; long tails add more."""

CERTAIN = 3.0
"""Standard deviations at which the search for sizes ends."""

SEED = 4
"""Seed of the draws: a recording always gives the same figures."""


@dataclass(frozen=True)
class Estimate:
    """Estimate of a figure, without the widening by noise.

    Attributes:
        u_um: standard uncertainty due to noise: the longer half of the 95 % interval over 1.96.
    """

    value_um: float
    u_um: float
    as_read_um: float


@dataclass(frozen=True, eq=False)
class DrawnPath:
    """One path's form and drawn noise, by sectors.

    Attributes:
        form_um: mean in each sector, shape (s,).
        highest_um: greatest noise, shape (draws, s).
        lowest_um: least noise, shape (draws, s).
        theta_deg: of the sectors, ascending, shape (s,).
        least: share of the noise if the whole spectrum were as low as its end.
        order: samples by angle, shape (m,).
        starts: each sector's first index in `order`, shape (s,).
    """

    form_um: Floats
    highest_um: Floats
    lowest_um: Floats
    theta_deg: Floats
    sigma_um: float
    least: float
    order: Integers
    starts: Integers

    def with_form(self, form_um: Floats) -> DrawnPath:
        """Return the noise with another form, given in time order, shape (n,) [µm]."""
        return replace(self, form_um=_means(form_um, self.order, self.starts))


def drawn_paths(
    apart: FormAndNoise,
    theta_deg: Floats,
    passed: Floats,
    seed: int,
    taken: Sequence[int] = (0,),
) -> tuple[DrawnPath, ...]:
    """Draw a path's noise, once per number of removed spectral lines.

    Args:
        apart: form, already filtered, and noise of the deviations in time order.
        theta_deg: angles of its samples, shape (n,) [deg].
        passed: amplitude that the filter passes, by line, shape (n // 2 + 1,).
        taken: for each path, how many of the lowest lines the fit removes.
    """
    count = len(theta_deg)
    order, starts, middle_deg = _sectors(theta_deg, passed)
    # Draws of a long turn have the next length that is fast to transform. A sample takes the value at its share of the turn.
    size = next_fast_len(count, real=True) if count > LONG_TURN else count
    at = order * size // count
    rng = np.random.default_rng([SEED, seed])
    extremes = [np.empty((2, DRAWS, len(starts))) for _ in taken]
    waves = _waves(max(taken), at, size)
    for block in np.split(np.arange(DRAWS), BLOCKS):  # in blocks, to save memory
        lines = drawn_lines(apart, passed, (len(block), size), rng)
        noise = np.fft.irfft(lines, size, axis=1)
        for each, first in zip(extremes, taken, strict=True):
            sizes = np.ascontiguousarray(lines[:, :first]).view(np.float64)
            _extremes(noise, sizes, waves, at, np.append(starts, len(order)), *each[:, block[0] : block[-1] + 1])
    found = []
    for each, first in zip(extremes, taken, strict=True):
        left_passed = np.where(np.arange(len(passed)) < first, 0.0, passed)
        power = apart.power_um2 * left_passed**2
        found.append(
            DrawnPath(
                form_um=_means(apart.form_um, order, starts),
                highest_um=each[0],
                lowest_um=each[1],
                theta_deg=middle_deg,
                sigma_um=sqrt((2.0 * power.sum() - power[0]) / count),
                least=_least_share(apart.power_um2, left_passed),
                order=order,
                starts=starts,
            )
        )
    return tuple(found)


def _sectors(theta_deg: Floats, passed: Floats) -> tuple[Integers, Integers, Floats]:
    count = len(theta_deg)
    # Undulations of which the filter passes at least a hundredth of the power.
    points = POINTS_PER_UNDULATION * int(np.flatnonzero(passed > PASSED).max(initial=1))
    theta = np.mod(theta_deg, FULL_TURN_DEG)
    if points < min(count, SECTORS):
        order = np.arange(0, count, count // points)
        order = order[np.argsort(theta[order], kind="stable")]
        return order, np.arange(len(order)), theta[order]
    sectors = min(SECTORS, count)
    order = np.argsort(theta, kind="stable")
    sector = np.minimum((theta[order] * (sectors / FULL_TURN_DEG)).astype(np.int64), sectors - 1)
    starts = np.flatnonzero(np.diff(sector, prepend=-1))
    return order, starts, (sector[starts] + 0.5) * (FULL_TURN_DEG / sectors)


def _waves(lines: int, at: Integers, count: int) -> Floats:
    undulations = np.arange(lines)[:, None]
    angles = undulations * at * (2.0 * np.pi / count)
    share = np.where(undulations > 0, 2.0, 1.0) / count
    return np.asarray(np.hstack([share * np.cos(angles), -share * np.sin(angles)]).reshape(2 * lines, len(at)))


@compiled
def _extremes(
    noise: Floats,
    sizes: Floats,
    waves: Floats,
    order: Integers,
    edges: Integers,
    highest: Floats,
    lowest: Floats,
) -> None:
    left = np.empty(len(order))
    for draw in range(len(noise)):
        for k in range(len(order)):
            left[k] = noise[draw, order[k]]
        for wave in range(sizes.shape[1]):
            for k in range(len(order)):
                left[k] -= sizes[draw, wave] * waves[wave, k]
        for sector in range(len(edges) - 1):
            high = low = left[edges[sector]]
            for k in range(edges[sector] + 1, edges[sector + 1]):
                high, low = max(high, left[k]), min(low, left[k])
            highest[draw, sector], lowest[draw, sector] = high, low


def _means(values: Floats, order: Integers, starts: Integers) -> Floats:
    return np.asarray(np.add.reduceat(values[order], starts) / np.diff(np.append(starts, len(order))))


def _least_share(power_um2: Floats, passed: Floats) -> float:
    end = average_of(power_um2[-max(len(power_um2) // 3, 1) :])
    whole = sum_of(power_um2 * passed**2)
    return sqrt(np.sum(np.minimum(power_um2, end) * passed**2) / whole) if whole > 0.0 else 1.0


PASSED = 0.1
"""Least passed amplitude of undulations that affect the place of extremes."""

BLOCKS = 4


def estimated(paths: Sequence[DrawnPath], statistic: Statistic, as_read_um: float) -> Estimate:
    """Return a range without the contribution of noise.

    Args:
        paths: one or both directions, from one circle.
        statistic: figure of extremes, shape (draws, s), at angles, shape (s,); homogeneous of degree one.
    """
    # One recording cannot separate correlated noise from short form. If the spectrum rises above its end, the interval
    # covers the results of the whole spectrum and of its end.
    if not max(path.sigma_um for path in paths) > 0.0:
        return Estimate(as_read_um, 0.0, as_read_um)
    value, low, high, least_u = _interval(paths, statistic, as_read_um)
    if min(path.least for path in paths) <= ALIKE:
        quiet = [
            replace(
                path,
                highest_um=path.least * path.highest_um,
                lowest_um=path.least * path.lowest_um,
                sigma_um=path.least * path.sigma_um,
            )
            for path in paths
        ]
        of_end, lowest, highest, _ = _interval(quiet, statistic, as_read_um)
        value, low, high = 0.5 * (value + of_end), min(low, lowest), max(high, highest)
    u = max((value - low) / QUANTILE, (high - value) / QUANTILE, least_u)
    return Estimate(value, u, as_read_um)


ALIKE = 0.95
"""If the end of the spectrum has at least this relative noise, the spectrum counts as uniform: by chance the end of 240
lines is lower by a twentieth."""


def _interval(paths: Sequence[DrawnPath], statistic: Statistic, as_read_um: float) -> tuple[float, float, float, float]:
    """Return the value, both ends of its interval, and the least uncertainty [µm]."""
    angles = np.unique(np.concatenate([path.theta_deg for path in paths]))
    forms = [_at(angles, path.theta_deg, path.form_um[None, :], np.nan)[0] for path in paths]
    highest = [_at(angles, path.theta_deg, path.highest_um, -np.inf) for path in paths]
    lowest = [_at(angles, path.theta_deg, path.lowest_um, np.inf) for path in paths]

    # New arrays of this size cost ten times the sum in them.
    outer, inner, further = (np.empty_like(highest[0]) for _ in range(3))

    def at(size: float, *, noisy: bool) -> Floats:
        rows = slice(None if noisy else 1)
        for k, (form, high, low) in enumerate(zip(forms, highest, lowest, strict=True)):
            for total, noise, farther in ((outer[rows], high, np.fmax), (inner[rows], low, np.fmin)):
                own = further[rows] if k else total
                np.add(size * form, noise[rows] if noisy else 0.0, out=own)
                if k:
                    farther(total, own, out=total)
        return statistic(outer[rows], inner[rows], angles)

    of_form = float(at(1.0, noisy=False)[0])
    if not of_form > 0.0:
        return as_read_um, as_read_um, as_read_um, 0.0
    sigma_um = max(path.sigma_um for path in paths)
    tried: dict[float, Floats] = {}
    # Increase until hardly a draw is below the measured range; decrease until hardly a draw is above.
    for steps, side in ((STEPS[STEPS > 0.0], -1.0), (STEPS[STEPS < 0.0][::-1], 1.0)):
        for step in steps:
            size = max(as_read_um + float(step) * sigma_um, 0.0)
            if size not in tried:
                tried[size] = at(size / of_form, noisy=True)
            beyond = tried[size].mean() + side * CERTAIN * tried[size].std() - as_read_um
            if side * beyond <= 0.0:
                break
    sizes = np.array(sorted(tried))
    shown = np.array([tried[size] for size in sizes])
    mean, spread = shown.mean(axis=1), shown.std(axis=1)
    curves = (mean, *np.quantile(shown, [0.975, 0.025], axis=1))
    value, low, high = (float(np.interp(as_read_um, np.maximum.accumulate(curve), sizes)) for curve in curves)
    # The scatter of the readings bounds the interval from below.
    return value, low, high, 0.5 * float(np.interp(value, sizes, spread))


def _at(angles: Floats, theta_deg: Floats, values: Floats, elsewhere: float) -> Floats:
    if len(angles) == len(theta_deg):
        return values
    spread = np.full((len(values), len(angles)), elsewhere)
    spread[:, np.searchsorted(angles, theta_deg)] = values
    return spread


def range_of(outer: Floats, inner: Floats, _theta_deg: Floats) -> Floats:
    """Return the range, shape (draws,)."""
    return np.asarray(outer.max(axis=1) - inner.min(axis=1))


def greatest_of(outer: Floats, _inner: Floats, _theta: Floats) -> Floats:
    """Return the greatest outward deviation, shape (draws,)."""
    return np.asarray(outer.max(axis=1))


def least_of(_outer: Floats, inner: Floats, _theta: Floats) -> Floats:
    """Return the greatest inward deviation, shape (draws,)."""
    return np.asarray(-inner.min(axis=1))


def farthest_of(outer: Floats, inner: Floats, _theta: Floats) -> Floats:
    """Return the greatest deviation, shape (draws,)."""
    return np.asarray(np.maximum(outer.max(axis=1), -inner.min(axis=1)))


LONG = 100.0
"""Length in standard uncertainties above which noise perpendicular to the vector is negligible: it adds 1/200 of one."""

AXES = 2
"""Degrees of freedom."""


def without_noise(length: float, u: float) -> tuple[float, float]:
    """Return the true length whose median measured length is the given one, with standard uncertainty."""
    # With uncertainty u per axis the length has Rice's distribution [Rice, Bell System Technical Journal 24 (1945) 46,
    # sec. 3.10]. Inverting the percentiles 2.5 and 97.5 gives the 95 % interval [confidence interval by inversion of a
    # test, Casella and Berger, Statistical Inference, 9.2.1]. The uncertainty is its longer side over 1.96, at least u.
    if not u > 0.0 or length > LONG * u:
        return sqrt(length**2 - u**2), u
    square = (length / u) ** 2

    def shows(share: float) -> float:
        """Return the true length, in u, that is measured shorter than `length` with probability `share`."""
        return sqrt(chndtrinc(square, AXES, share)) if chndtr(square, AXES, 0.0) > share else 0.0

    low, value, high = (shows(share) for share in (0.975, 0.5, 0.025))
    return u * value, u * max(value - low, high - value, QUANTILE) / QUANTILE
