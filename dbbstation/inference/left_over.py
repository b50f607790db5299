"""Test whether a residual is noise.

The residual must pass all tests. Each gives a chance probability times the number of trials [Bonferroni; Miller,
Simultaneous Statistical Inference, 2nd ed., sec. 1.3].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr

from dbbstation.inference.triangle import root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.variables import Variable

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
