"""Whether what a hypothesis leaves is noise: its sum of squares, its periodogram, its runs of sign, its blocks, its variables.

"Nothing is left beyond noise" holds only where all of these pass. Each is a probability by chance, times the number of things
that were looked at [Bonferroni; Miller, Simultaneous Statistical Inference, 2nd ed., sec. 1.3].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2, f, norm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.noise import Noise
    from dbbstation.inference.variables import Variable

SIGNIFICANT = 0.001
"""Probability by chance, over all tests, below which something is left."""

BINS = 20
"""Pieces of a variable that are asked for by themselves, with as many rows in each."""

FEWEST = 20
"""Averages of rows that a test of their order needs."""


@dataclass(frozen=True)
class Look:
    """One way of asking whether something is left.

    Attributes:
        name: `sum of squares`, `wave in time`, `runs of sign`, `blocks`, or a variable.
        probability: that noise alone leaves as much.
        rms: of what stands out, beyond noise, in the unit of the residual.
        where: place, in words; empty where it has none.
    """

    name: str
    probability: float
    rms: float
    where: str


@dataclass(frozen=True)
class LeftOver:
    """What is left, looked at in all these ways."""

    looks: tuple[Look, ...]

    @property
    def worst(self) -> Look:
        """The one that is least probable by chance."""
        return min(self.looks, key=lambda look: look.probability)

    @property
    def probability(self) -> float:
        """That noise alone leaves as much in any of these ways."""
        return min(1.0, len(self.looks) * self.worst.probability)

    @property
    def is_noise(self) -> bool:
        """Whether nothing is left beyond noise."""
        return self.probability >= SIGNIFICANT


def left_over(
    left: NDArray[np.float64],
    blocks: Sequence[slice],
    variables: Sequence[Variable],
    noise: Noise,
    freedom: tuple[float, float],
    *,
    ordered: bool,
) -> LeftOver:
    """Test what a hypothesis leaves.

    Args:
        left: rows, shape (n,).
        blocks: of these rows.
        variables: of these rows.
        noise: of one row, measured apart.
        freedom: degrees of freedom of the residual and of the noise.
        ordered: whether rows are in time order.
    """
    square = float(left @ left) / noise.sigma**2
    count, known = freedom[0] / noise.correlation_samples, max(freedom[1] / noise.correlation_samples, 1.0)
    beyond = float(np.sqrt(max(square / freedom[0] - 1.0, 0.0))) * noise.sigma
    looks = [Look("sum of squares", float(f.sf(square / freedom[0], max(count, 1.0), known)), beyond, "")]
    if ordered:
        looks += _in_order(left, blocks, noise)
    if len(blocks) > 1:
        looks.append(_by_block(left, blocks, noise))
    looks += [_over(left, variable, noise) for variable in variables if len(np.unique(variable.values)) > 1]
    return LeftOver(tuple(looks))


def _in_order(left: NDArray[np.float64], blocks: Sequence[slice], noise: Noise) -> list[Look]:
    """Wave in time, and runs of one sign, of rows averaged until neighbours are independent."""
    per = max(1, int(np.ceil(2.0 * noise.correlation_samples))) if noise.correlation_samples > 1.0 else 1
    means = [
        left[rows][: (rows.stop - rows.start) // per * per].reshape(-1, per).mean(axis=1)
        for rows in blocks
        if rows.stop - rows.start >= per
    ]
    longest = max(means, key=len, default=np.zeros(0))
    found = []
    if len(longest) >= FEWEST:
        power = np.abs(np.fft.rfft(longest - longest.mean())[1 : (len(longest) + 1) // 2]) ** 2
        at = int(power.argmax())
        # Share of the largest of m exponential powers [Fisher, Proc. R. Soc. A 125 (1929) 54].
        share = float(power[at] / power.sum())
        chance = min(1.0, len(power) * (1.0 - share) ** (len(power) - 1))
        size = float(np.sqrt(2.0 * power[at])) / len(longest)
        found.append(Look("wave in time", chance, size, f"about every {len(longest) / (at + 1) * per:.4g} rows"))
    signs = np.concatenate([np.zeros(0), *(np.sign(m) for m in means)])
    signs = signs[signs != 0.0]
    up, down = float((signs > 0).sum()), float((signs < 0).sum())
    if min(up, down) >= FEWEST / 2:
        runs = 1.0 + float((np.diff(signs) != 0.0).sum())
        total = up + down
        expected = 1.0 + 2.0 * up * down / total
        variance = (expected - 1.0) * (expected - 2.0) / (total - 1.0)  # [Wald and Wolfowitz, 1940]
        z = (runs - expected) / float(np.sqrt(max(variance, 1e-12)))
        found.append(Look("runs of sign", float(norm.cdf(z)), float(np.std(np.concatenate(means))), ""))
    return found


def _by_block(left: NDArray[np.float64], blocks: Sequence[slice], noise: Noise) -> Look:
    """Means of blocks."""
    counts = np.array([rows.stop - rows.start for rows in blocks], dtype=np.float64)
    means = np.array([left[rows].mean() for rows in blocks])
    terms = counts * means**2 / noise.effective**2
    worst = int(terms.argmax())
    return Look(
        "blocks", float(chi2.sf(terms.sum(), len(blocks))), abs(float(means[worst])), f"most in block {worst + 1}"
    )


def _over(left: NDArray[np.float64], variable: Variable, noise: Noise) -> Look:
    """Means over pieces of a variable with as many rows in each."""
    values = variable.values
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
    counts = np.bincount(place, minlength=len(edges) - 1).astype(np.float64)
    means = np.bincount(place, left, minlength=len(edges) - 1) / np.maximum(counts, 1.0)
    terms = counts * means**2 / noise.effective**2
    worst = int(terms.argmax())
    ends = edges[[worst, min(worst + 1, len(edges) - 1)]]
    where = f"most from {ends[0]:.4g} to {ends[1]:.4g} {variable.unit}".strip()
    return Look(variable.name, float(chi2.sf(terms.sum(), len(terms))), abs(float(means[worst])), where)
