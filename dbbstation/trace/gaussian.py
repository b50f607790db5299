"""The Gaussian filter of a closed profile, by undulations per revolution [ISO 16610-21:2011, clause 5]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.quantities import FULL_TURN_DEG

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

LEAST_CELLS = 4096
CELLS_PER_SAMPLE = 4
"""Grid cells per sample. Distribution to the cells loses a thousandth of the shortest undulation that the samples
resolve."""


def transmission(undulations: Floats, cut_off_upr: float) -> Floats:
    """Return an undulation's transmitted share, 0.5 at the cut-off.

    exp(-π (α k / k_c)²), α = sqrt(ln 2 / π), which is 2^-(k / k_c)² [ISO 16610-21:2011, 5.3].
    """
    return np.asarray(np.exp2(-((undulations / cut_off_upr) ** 2)), dtype=np.float64)


def gaussian(theta_deg: Floats, values: Floats, cut_off_upr: float) -> Floats:
    """Return a closed profile without short undulations, at the same angles.

    Args:
        cut_off_upr: undulation that passes with half its amplitude.
    """
    cells = max(LEAST_CELLS, 1 << int(np.ceil(np.log2(CELLS_PER_SAMPLE * len(theta_deg)))))
    place = np.mod(theta_deg, FULL_TURN_DEG) / FULL_TURN_DEG * cells
    order = np.argsort(place)
    ordered = place[order]
    gap = np.diff(ordered, append=ordered[0] + cells)
    arc = np.empty_like(gap)
    arc[order] = 0.5 * (gap + np.roll(gap, 1))
    lower = np.floor(place)
    share, lower = place - lower, lower.astype(np.int64) % cells
    upper = (lower + 1) % cells

    passed = transmission(np.arange(cells // 2 + 1.0), cut_off_upr)

    def spread(amount: Floats) -> Floats:
        on_cells = np.bincount(lower, amount * (1.0 - share), cells) + np.bincount(upper, amount * share, cells)
        return np.fft.irfft(np.fft.rfft(on_cells) * passed, cells)

    smooth = spread(values * arc) / spread(arc)
    return (1.0 - share) * smooth[lower] + share * smooth[upper]
