"""Whether what a model leaves is larger in some stretches than elsewhere: what noise that is the same everywhere does not do.

A quick oscillation lies above the harmonics that a model is asked for, where noise is read from. It then counts as noise and hides.
Noise is there all the time; an oscillation that begins with an event is there after the event only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import f as f_distribution

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

FEWEST = 8
"""Stretches of either kind that a comparison of their mean squares needs, at the least."""


@dataclass(frozen=True)
class Louder:
    """Mean squares in some stretches against those elsewhere.

    Attributes:
        probability: that stretches picked by chance are as much louder.
    """

    probability: float
    rms: float
    elsewhere: float

    @property
    def beyond(self) -> float:
        """What these stretches have beyond the others, root mean square in the unit of the residual."""
        return float(np.sqrt(max(self.rms**2 - self.elsewhere**2, 0.0)))


def louder(residuals: Sequence[NDArray[np.float64]], begins: Sequence[NDArray[np.int64]], length: int) -> Louder | None:
    """Compare stretches of so many rows that begin in some rows with all others of the same length; None where they are too few.

    Mean squares of stretches scatter by more than those of white noise do where neighbours resemble each other. So their degrees of
    freedom are read from the scatter itself, 2 mean² / variance each [Satterthwaite, Biometrics Bulletin 2 (1946) 110].

    Args:
        residuals: of each run, in the order of time, shape (n,).
        begins: rows of each run in which a stretch begins, in any order.
    """
    inside, outside = [], []
    for residual, rows in zip(residuals, begins, strict=True):
        squares, taken = residual**2, np.zeros(len(residual), dtype=bool)
        for row in rows.tolist():
            own = slice(row, row + length)
            # A stretch that runs into the one before it is not counted twice.
            if row + length <= len(residual) and not taken[own].any():
                inside.append(float(squares[own].mean()))
            taken[own] = True
        starts = range(0, len(residual) - length + 1, length)
        outside += [float(squares[k : k + length].mean()) for k in starts if not taken[k : k + length].any()]
    if min(len(inside), len(outside)) < FEWEST:
        return None
    there, elsewhere = float(np.mean(inside)), float(np.mean(outside))
    spread = float(np.var(outside, ddof=1))
    if not (elsewhere > 0.0 and spread > 0.0):
        return None
    each = 2.0 * elsewhere**2 / spread
    chance = float(f_distribution.sf(there / elsewhere, each * len(inside), each * len(outside)))
    return Louder(chance, float(np.sqrt(there)), float(np.sqrt(elsewhere)))
