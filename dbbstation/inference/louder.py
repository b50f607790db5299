"""Test whether a residual is larger in some stretches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from dbbstation.inference.triangle import root

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers

FEWEST = 8
"""Fewest stretches of each kind for a comparison of mean squares."""


@dataclass(frozen=True)
class Louder:
    """Mean squares in some stretches, compared with other stretches."""

    probability: float
    rms: float
    elsewhere: float

    @property
    def beyond(self) -> float:
        """Return the stretches' excess rms, in the residual's unit."""
        return root(self.rms**2 - self.elsewhere**2)


def louder(residuals: Sequence[Floats], begins: Sequence[Integers], length: int) -> Louder | None:
    """Compare the stretches that begin at given rows with other stretches of equal length; None for too few.

    Correlated mean squares have 2 mean² / variance degrees of freedom [Satterthwaite, Biometrics Bulletin 2 (1946) 110].

    Args:
        begins: first rows of stretches per run, unordered.
    """
    inside, outside = [], []
    for residual, rows in zip(residuals, begins, strict=True):
        squares, taken = residual**2, np.zeros(len(residual), dtype=bool)
        for row in rows.tolist():
            own = slice(row, row + length)
            # A stretch that overlaps the previous one is not counted.
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
    chance = float(fdtrc(each * len(inside), each * len(outside), there / elsewhere))
    return Louder(chance, float(np.sqrt(there)), float(np.sqrt(elsewhere)))
