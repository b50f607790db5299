"""Test whether a residual is noise, and find where it differs.

The residual must pass all tests. Each gives a chance probability times the number of trials [Bonferroni; Miller,
Simultaneous Statistical Inference, 2nd ed., sec. 1.3]. A total sum of squares would hide single features.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import bands, centred_coefficients
from dbbstation.inference.triangle import root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.channel import Variable
    from dbbstation.inference.harmonics import Spectrum
    from dbbstation.inference.settle import Settled


SIGNIFICANT = 0.001
"""Chance probability over all tests below which a residual effect remains."""

COUNTS_SIGMA = 4.0
"""Standard deviations above which a smoothed deviation counts as misfit."""

BINS = 20
"""Bins of a variable that are tested separately, with equal numbers of rows."""

FEWEST = 20
"""Fewest rows for a test of their order."""


@dataclass(frozen=True)
class ResidualTest:
    """Result of one test for a residual effect.

    Attributes:
        name: `sum of squares`, `wave in time`, `runs of sign`, `blocks`, or a variable.
        rms: residual beyond noise, in the residual's unit.
    """

    name: str
    probability: float
    rms: float
    where: str


@dataclass(frozen=True)
class LeftOver:
    """Results of all tests for residual effects."""

    is_noise: bool
    probability: float
    looks: tuple[ResidualTest, ...]

    @property
    def worst(self) -> ResidualTest:
        """Return the test with the least probability."""
        return min(self.looks, key=lambda look: look.probability)


def left_over(settled: Settled) -> LeftOver:
    """Test the best hypothesis's whitened residual."""
    channel, bank = settled.channel, settled.bank
    rows = settled.left
    left = bank.whitened(rows) / settled.noise.innovation
    used = sum(member.width for member in settled.best.members) + channel.base.samples.shape[1]
    freedom = max(float(len(left) - used), 1.0)
    square = float(left @ left) / freedom
    beyond = root(square - 1.0) * settled.noise.sigma
    # The noise was estimated on the same rows with more columns, so it is about as uncertain as the square.
    looks = [ResidualTest("sum of squares", float(fdtrc(freedom, freedom, square)), beyond, "")]
    if channel.time is not None:
        looks += _in_order(left, channel.stretches, settled.noise.sigma)
    blocks = channel.kept_blocks
    if len(blocks) > 1:
        looks.append(_by_block(left, blocks, settled.noise.sigma))
    for variable in channel.variables:
        values = variable.values[channel.kept]
        if len(np.unique(values)) > 1:
            looks.append(_over(left, replace(variable, values=values), settled.noise.sigma))
    probability = min(1.0, len(looks) * min(look.probability for look in looks))
    return LeftOver(probability >= SIGNIFICANT, probability, tuple(looks))


def _in_order(left: Floats, stretches: Sequence[slice], sigma: float) -> list[ResidualTest]:
    longest = left[max(stretches, key=lambda rows: rows.stop - rows.start)]
    found = []
    if len(longest) >= FEWEST:
        power = np.abs(np.fft.rfft(longest - longest.mean())[1 : (len(longest) + 1) // 2]) ** 2
        at = int(power.argmax())
        # Distribution of the largest of m exponential powers, as share of their sum [Fisher, Proc. R. Soc. A 125 (1929)
        # 54].
        share = float(power[at] / max(float(power.sum()), 1e-300))
        chance = min(1.0, len(power) * (1.0 - share) ** (len(power) - 1))
        size = sigma * 2.0 * float(np.sqrt(power[at])) / len(longest) / float(np.sqrt(2.0))
        found.append(ResidualTest("wave in time", chance, size, f"about every {len(longest) / (at + 1):.4g} rows"))
    signs = np.sign(left)
    up, down = float((signs > 0).sum()), float((signs < 0).sum())
    if min(up, down) >= FEWEST / 2:
        runs = 1.0 + float((np.diff(signs[signs != 0.0]) != 0.0).sum())
        total = up + down
        expected = 1.0 + 2.0 * up * down / total
        variance = (expected - 1.0) * (expected - 2.0) / (total - 1.0)  # [Wald and Wolfowitz, 1940]
        z = (runs - expected) / float(np.sqrt(max(variance, 1e-12)))
        found.append(ResidualTest("runs of sign", float(ndtr(z)), sigma * float(np.std(left)), ""))
    return found


def _by_block(left: Floats, blocks: Sequence[slice], sigma: float) -> ResidualTest:
    counts = np.array([rows.stop - rows.start for rows in blocks], dtype=np.float64)
    means = np.array([left[rows].mean() for rows in blocks])
    terms = counts * means**2
    worst = int(terms.argmax())
    size = sigma * abs(float(means[worst]))
    return ResidualTest("blocks", float(chdtrc(len(blocks), terms.sum())), size, f"most in block {worst + 1}")


def _over(left: Floats, variable: Variable, sigma: float) -> ResidualTest:
    values = variable.values
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
    counts = np.bincount(place, minlength=len(edges) - 1).astype(np.float64)
    means = np.bincount(place, left, minlength=len(edges) - 1) / np.maximum(counts, 1.0)
    terms = counts * means**2
    worst = int(terms.argmax())
    ends = edges[[worst, min(worst + 1, len(edges) - 1)]]
    where = f"most from {ends[0]:.4g} to {ends[1]:.4g} {variable.unit}".strip()
    return ResidualTest(variable.name, float(chdtrc(len(terms), terms.sum())), sigma * abs(float(means[worst])), where)


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
